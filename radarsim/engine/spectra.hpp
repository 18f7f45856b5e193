// Beat signals of sweeps, their spectra, and target detectors; see beat_signal.py and detection.py for the theory.
#pragma once
#include "bindings.hpp"

namespace radarsim::fmcw {

// Numpy's random generator PCG64. Source: M. E. O'Neill, PCG: A Family of Simple Fast Space-Efficient Statistically
// Good Algorithms for Random Number Generation, 2014.
using Word128 = unsigned __int128;

constexpr Word128 joined(uint64_t high, uint64_t low) { return Word128(high) << 64 | low; }
constexpr Word128 MULTIPLIER = joined(0x2360ED051FC65DA4, 0x4385DF649FCCF645);
// Number of steps from one stream to the next: the period divided by the golden ratio. With a multiple of a large power
// of two, the lower half of the state would be the same in all streams, and their numbers would be correlated.
constexpr Word128 STRIDE = joined(0x9E3779B97F4A7C15, 0xF39CC0605CEDC835);

// Several steps of the generator as a single one: state * factor + sum.
struct Jump {
    Word128 factor = 1, sum = 0;

    Jump(Word128 increment, Word128 steps) {
        Word128 step_factor = MULTIPLIER, step_sum = increment; // for 1, 2, 4 ... steps
        for (; steps; steps >>= 1) {
            if (steps & 1) factor *= step_factor, sum = sum * step_factor + step_sum;
            step_sum *= step_factor + 1, step_factor *= step_factor;
        }
    }
    Word128 operator()(Word128 state) const { return state * factor + sum; }
};

// Fill each row with the first standard normal numbers of a stream of a generator, one stream after the other. The
// words are the generator's state and increment, each with the upper half first. A number is the count of ones in 32
// random bits, minus its mean, divided by its standard deviation; sums of several numbers are almost exactly normal.
inline void fill_normal(Array<const uint64_t> words, int64_t first, Array<float, 2> rows) {
    constexpr int BITS = 32;
    Word128 increment = joined(words[2], words[3]);
    Word128 start = Jump(increment, first * STRIDE)(joined(words[0], words[1]));
    Jump next(increment, STRIDE);
    float scale = float(2.0 / sqrt(double(BITS)));
    auto normal = [&](uint32_t bits) { return scale * float(__builtin_popcount(bits) - BITS / 2); };
    for (int64_t row = 0; row < rows.shape[0]; row++, start = next(start)) {
        Word128 state = start;
        float* out = rows.row(row);
        for (int64_t i = 0; i < rows.shape[1]; i += 2) { // each word of 64 bits makes two numbers
            state = state * MULTIPLIER + increment;
            uint64_t mixed = uint64_t(state >> 64) ^ uint64_t(state), turn = uint64_t(state >> 122);
            uint64_t word = mixed >> turn | mixed << (-turn & 63);
            out[i] = normal(uint32_t(word));
            if (i + 1 < rows.shape[1]) out[i + 1] = normal(uint32_t(word >> 32));
        }
    }
}
BIND(fill_normal, "4 rb")

// Compute the power of complex spectra, multiplied by the shape of the noise in each bin.
inline bool square_spectra(Array<const float[2], 2> spectra, Array<const float> shape, Array<float, 2> power) {
    if (spectra.shape[1] < shape.size()) return false;
    for (int64_t row = 0; row < power.shape[0]; row++)
        for (int64_t bin = 0; bin < shape.size(); bin++) {
            const auto& [real, imaginary] = spectra(row, bin);
            power(row, bin) = shape[bin] * (real * real + imaginary * imaginary);
        }
    return true;
}
BIND(square_spectra, "rs b rb")

// SIMD vectors, which the compiler splits into vectors of the width of the registers.
using Doubles = double __attribute__((vector_size(128)));
using Floats = float __attribute__((vector_size(64)));
constexpr int64_t LANES = 16;

// Add cosines to the first samples of rows of sweeps; turns are angular frequencies in rad per sample.
inline bool add_cosines(Array<float, 2> sweeps, int64_t samples, Array<const int64_t> rows, Array<const double> turns,
                        Array<const double> phases, Array<const double> amplitudes) {
    if (samples < 0 || samples > sweeps.shape[1]) return false;
    for (int64_t k = 0; k < rows.size(); k++) {
        if (rows[k] < 0 || rows[k] >= sweeps.shape[0]) return false;
        // The recurrence is cos(a + b) = 2 cos(a) cos(b) - cos(a - b), where b is the phase of LANES samples. Over a
        // sweep its error stays below the rounding error of float32.
        Doubles last, next;
        for (int64_t n = 0; n < LANES; n++) {
            last[n] = amplitudes[k] * cos(turns[k] * n + phases[k]);
            next[n] = amplitudes[k] * cos(turns[k] * (n + LANES) + phases[k]);
        }
        double factor = 2.0 * cos(LANES * turns[k]);
        float* sweep = &sweeps(rows[k], 0);
        for (int64_t n = 0; n < samples; n += LANES) {
            if (samples - n < LANES) {
                for (int64_t lane = 0; lane < samples - n; lane++) sweep[n + lane] += float(last[lane]);
                break;
            }
            Floats sum;
            memcpy(&sum, sweep + n, sizeof sum);
            sum += __builtin_convertvector(last, Floats);
            memcpy(sweep + n, &sum, sizeof sum);
            Doubles before = last;
            last = next, next = factor * next - before;
        }
    }
    return true;
}
BIND(add_cosines, "rs k k k k")

// Add noise to sweeps, whose amplitude differs from sweep to sweep, clip the sums, and multiply them by a window. The
// samples after the window become 0.
inline bool add_noise(Array<float, 2> sweeps, Array<const float, 2> noise, Array<const float> amplitudes, double low,
                      double high, Array<const float> window) {
    if (window.size() > sweeps.shape[1] || window.size() > noise.shape[1]) return false;
    for (int64_t row = 0; row < sweeps.shape[0]; row++) {
        float *sweep = sweeps.row(row), amplitude = amplitudes[row];
        const float* white = noise.row(row);
        for (int64_t i = 0; i < window.size(); i++)
            sweep[i] = window[i] * minimum(maximum(sweep[i] + amplitude * white[i], float(low)), float(high));
        memset(sweep + window.size(), 0, (sweeps.shape[1] - window.size()) * sizeof(float));
    }
    return true;
}
BIND(add_noise, "rs rn r w")

// Find the strongest bin in each run of consecutive set bins, since a strong echo sets all bins of its main lobe.
inline void find_peaks(Array<const bool, 2> mask, Array<const float, 2> power, Array<bool, 2> peaks) {
    for (int64_t row = 0; row < mask.shape[0]; row++) {
        int64_t best = -1;
        for (int64_t bin = 0; bin < mask.shape[1]; bin++) {
            if (!mask(row, bin)) {
                best = -1;
            } else if (best < 0 || power(row, bin) > power(row, best)) {
                if (best >= 0) peaks(row, best) = false;
                peaks(row, bin) = true;
                best = bin;
            }
        }
    }
}
BIND(find_peaks, "rb rb rb")

struct Neighbours { // the training bins on each side of a bin; half is their number on a side
    int64_t nearest, step, half;

    int64_t farthest() const { return nearest + (half - 1) * step; }
    bool is_valid() const {
        auto is_count = [](int64_t number) { return 1 <= number && number <= 1 << 20; };
        return is_count(nearest) && is_count(step) && is_count(half);
    }
};

// CA-CFAR detector: find the bins that exceed the mean of their training bins by a factor, which differs for training
// bins on one side and on both sides. Returns whether the training bins are valid.
inline int64_t find_ca(Array<const float, 2> power, int64_t nearest, int64_t step, int64_t half, double one_side,
                    double both_sides, Array<bool, 2> found) {
    Neighbours around = {nearest, step, half};
    if (!around.is_valid()) return false;
    int64_t count = power.shape[1], farthest = around.farthest(), length = count + nearest;
    // The sums are over the training bins before each bin. The training bins after a bin are the training bins before
    // the bin that is this far ahead, which may be beyond the last bin.
    int64_t ahead = nearest + farthest;
    int64_t start = farthest < count ? farthest : count, end = count > farthest ? count - farthest : 0;
    int64_t low = start < end ? start : end, high = start + end - low;
    Buffer<double> sums(length);
    for (int64_t row = 0; row < power.shape[0]; row++) {
        const float* line = &power(row, 0);
        bool* is_found = &found(row, 0);
        for (int64_t i = farthest; i < farthest + step && i < length; i++) {
            sums[i] = 0.0;
            for (int64_t q = 0; q < half; q++) sums[i] += line[i - nearest - q * step];
        }
        // Bins that are a step apart have all training bins in common except two.
        for (int64_t i = farthest + step; i < length; i++)
            sums[i] = sums[i - step] + line[i - nearest] - line[i - step - farthest];
        for (int64_t i = 0; i < low; i++) is_found[i] = line[i] > one_side * (sums[i + ahead] / half);
        for (int64_t i = start; i < end; i++)
            is_found[i] = line[i] > both_sides * ((sums[i] + sums[i + ahead]) / (2 * half));
        for (int64_t i = high; i < count; i++) is_found[i] = line[i] > one_side * (sums[i] / half);
    }
    return true;
}
BIND(find_ca, "rb rb")

// A histogram of levels for order statistics; it tracks how many entries are below the current level.
class LevelHistogram {
  public:
    void clear() { *this = {}; }
    void move(float value, int change) {
        int64_t level = value >= LEVELS ? LEVELS - 1 : value > 0.0f ? int64_t(value) : 0;
        counts_[level] += change;
        if (level < current_) below_ += change;
    }
    // Return the level of the entry with this rank, from 1 to the count. The search starts at the current level, since
    // results for neighbouring bins mostly differ by a few levels.
    int64_t find(int64_t order) {
        while (below_ + counts_[current_] < order) below_ += counts_[current_++];
        while (below_ >= order) below_ -= counts_[--current_];
        return current_;
    }

  private:
    static constexpr int64_t LEVELS = 2048;
    int32_t counts_[LEVELS] = {};
    int64_t current_ = 0, below_ = 0;
};

// OS-CFAR detector: find the bins from start to end whose level exceeds the level of the given order among their
// training bins. From a bin to the bin a step away, two training bins change on each side, so the histogram is updated
// instead of built again. Returns whether the numbers are valid.
inline int64_t find_os(Array<const float, 2> levels, int64_t nearest, int64_t step, int64_t half, int64_t start,
                    int64_t end, bool behind, bool ahead, int64_t order, double above, Array<bool, 2> found) {
    Neighbours around = {nearest, step, half};
    if (!around.is_valid()) return false;
    int64_t farthest = around.farthest(), least_start = behind ? farthest : 0;
    int64_t most_end = levels.shape[1] - (ahead ? farthest : 0);
    if (start >= end) return true;
    if (start < least_start || end > most_end || order < 1 || order > half * (behind + ahead)) return false;
    LevelHistogram histogram;
    for (int64_t row = 0; row < levels.shape[0]; row++) {
        const float* line = &levels(row, 0);
        for (int64_t first = start; first < start + step && first < end; first++) {
            histogram.clear();
            for (int64_t q = 0; q < half; q++) {
                if (behind) histogram.move(line[first - nearest - q * step], 1);
                if (ahead) histogram.move(line[first + nearest + q * step], 1);
            }
            for (int64_t i = first; i < end; i += step) {
                int64_t last = i - step;
                if (behind && i > first)
                    histogram.move(line[last - farthest], -1), histogram.move(line[i - nearest], 1);
                if (ahead && i > first)
                    histogram.move(line[last + nearest], -1), histogram.move(line[i + farthest], 1);
                // On average the value of the training bin is in the middle of its level.
                found(row, i) = line[i] > double(histogram.find(order)) + 0.5 + above;
            }
        }
    }
    return true;
}
BIND(find_os, "rb rb")

} // namespace radarsim::fmcw
