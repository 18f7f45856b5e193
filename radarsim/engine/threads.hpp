// Work on several threads inside one call.
#pragma once
#include "numbers.hpp"
#include <pthread.h>
#include <signal.h>

namespace radarsim {

// Calls work(part) for each part from 0, on some threads that take the next part when they are ready. What a part
// does must not depend on which thread does it: then the results are the same for any number of threads.
template <typename Work> class ParallelWork {
  public:
    ParallelWork(int64_t threads, int64_t parts, Work& work) : parts_(parts), work_(work) {
        Room<pthread_t> others(threads);
        int64_t started = 0;
        sigset_t all, before;
        sigfillset(&all);
        pthread_sigmask(SIG_BLOCK, &all, &before); // signals are for the threads of the program
        for (; started < least_of(threads, parts) - 1; started++)
            if (pthread_create(&others[started], nullptr, run, this)) break; // then those that there are do it all
        pthread_sigmask(SIG_SETMASK, &before, nullptr);
        run(this);
        for (int64_t i = 0; i < started; i++) pthread_join(others[i], nullptr);
    }

  private:
    static int64_t least_of(int64_t a, int64_t b) { return a < b ? a : b; }
    static void* run(void* self) {
        auto& [parts, next, work] = *static_cast<ParallelWork*>(self);
        for (int64_t part; (part = __atomic_fetch_add(&next, 1, __ATOMIC_RELAXED)) < parts;) work(part);
        return nullptr;
    }

    int64_t parts_, next_ = 0;
    Work& work_;
};

} // namespace radarsim
