// Arithmetic with the results of Python, and arrays, buffers and lists.
#pragma once
#include <math.h> // no headers of C++, since building its standard library takes minutes
#include <setjmp.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

namespace radarsim {

class Memory;

using Triangle = double[9]; // x, y and z of each corner, m

struct Vector { // x, y and z
    double numbers[3];

    double& operator[](int64_t axis) { return numbers[axis]; }
    double operator[](int64_t axis) const { return numbers[axis]; }
};
inline Vector operator+(const Vector& a, const Vector& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
inline Vector operator-(const Vector& a, const Vector& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline Vector operator*(double factor, const Vector& a) { return {factor * a[0], factor * a[1], factor * a[2]}; }
inline Vector operator/(const Vector& a, double divisor) { return {a[0] / divisor, a[1] / divisor, a[2] / divisor}; }
inline double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline double length_of(const Vector& a) { return sqrt(dot(a, a)); }

// Return one of the three corners of a triangle.
inline const Vector& corner_of(const Triangle& triangle, int corner) {
    return reinterpret_cast<const Vector&>(triangle[3 * corner]);
}

constexpr double INFINITE = __builtin_inf(), NOT_A_NUMBER = __builtin_nan("");

// Minimum and maximum as in Python: the first argument if both are equal or one is NaN.
template <typename T> T minimum(T a, T b) { return b < a ? b : a; }
template <typename T> T maximum(T a, T b) { return b > a ? b : a; }
template <typename T> T minimum(T a, T b, T c) { return minimum(minimum(a, b), c); }
template <typename T> T maximum(T a, T b, T c) { return maximum(maximum(a, b), c); }

// Binary search: return the least integer from low to high - 1 for which a condition holds, or high if there is none.
// If the condition holds for a number, it must hold for all greater numbers.
template <typename F> int64_t first_where(int64_t low, int64_t high, F holds) {
    while (low < high) {
        int64_t middle = (low + high) / 2;
        if (holds(middle)) high = middle;
        else low = middle + 1;
    }
    return low;
}

// Return an angle, rad, wrapped to (-pi, pi].
inline double wrap_angle(double angle) {
    if (fabs(angle) < M_PI) return angle; // remainder() takes as long as the rest of a robot's move
    double wrapped = remainder(angle, 2 * M_PI);
    return wrapped <= -M_PI ? M_PI : wrapped;
}

// Return a number truncated to an integer; INT64_MIN if it is too large or NaN.
inline int64_t whole_of(double number) { return fabs(number) < 0x1p63 ? int64_t(number) : INT64_MIN; }

// An array whose memory belongs to numpy; T is a number or a row such as Vector.
template <typename T, int D = 1> struct Array {
    T* data;
    int64_t shape[D];

    int64_t size() const { return shape[0]; }
    T& operator[](int64_t i) const { return data[i]; }
    T& operator()(int64_t i, int64_t j) const { return data[i * shape[1] + j]; }
    T& operator()(int64_t i, int64_t j, int64_t k) const { return data[(i * shape[1] + j) * shape[2] + k]; }
    T* row(int64_t i) const { return data + i * shape[1]; } // for arrays with two axes
    T* begin() const { return data; }
    T* end() const { return data + size(); }
};

// Runs the work of a call or of one of its threads. If memory runs out, the work is aborted and its buffers are freed.
class Attempt {
  public:
    bool succeeds = true;

    template <typename Work> explicit Attempt(Work work) : outer_(current_) {
        current_ = this;
        if (setjmp(start_)) succeeds = false;
        else work();
        current_ = outer_;
    }
    Attempt(const Attempt&) = delete;
    Attempt& operator=(const Attempt&) = delete;
    [[noreturn]] static void fail();

  private:
    friend class Memory;
    jmp_buf start_;
    Attempt* outer_;
    Memory* last_ = nullptr;
    static inline thread_local Attempt* current_ = nullptr;
};

// Base class that owns the memory of an object; the attempt fails if memory runs out.
class Memory {
  protected:
    Memory() : before_(Attempt::current_->last_) { Attempt::current_->last_ = this; }
    ~Memory() {
        free(data_);
        Attempt::current_->last_ = before_;
    }
    Memory(const Memory&) = delete;
    Memory& operator=(const Memory&) = delete;
    void hold(void* data) {
        if (!data) Attempt::fail();
        data_ = data;
    }
    void* data_ = nullptr;

  private:
    friend class Attempt;
    Memory* before_; // previous object of the attempt; objects are destroyed in reverse order
};

inline void Attempt::fail() {
    for (Memory* memory = current_->last_; memory; memory = memory->before_) free(memory->data_);
    longjmp(current_->start_, 1);
}

// Memory for an array, initialised with zeros.
template <typename T> class Buffer : Memory {
  public:
    explicit Buffer(int64_t size) { hold(calloc(size + 1, sizeof(T))); }
    T* data() const { return static_cast<T*>(data_); }
    T& operator[](int64_t i) const { return data()[i]; }
};

// A list with a fixed capacity; the caller must not exceed it.
template <typename T> class List {
  public:
    explicit List(int64_t capacity) : room_(capacity), capacity_(capacity) {}
    int64_t size() const { return size_; }
    int64_t capacity() const { return capacity_; }
    T& operator[](int64_t i) const { return room_[i]; }
    T* begin() const { return room_.data(); }
    T* end() const { return room_.data() + size_; }
    void append(T value) { room_[size_++] = value; }
    void clear() { shorten(0); }
    void shorten(int64_t size) { size_ = size; }
    // Remove the first entry with a value, if there is one; later entries move forward.
    void remove(T value) {
        int64_t i = 0;
        while (i < size_ && room_[i] != value) i++;
        if (i == size_) return;
        for (size_--; i < size_; i++) room_[i] = room_[i + 1];
    }

  private:
    Buffer<T> room_;
    int64_t capacity_, size_ = 0;
};

} // namespace radarsim
