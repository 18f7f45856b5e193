// Sweeps, their spectra, and detectors of targets in these; see beat_signal.py and detection.py for the theory.
#pragma once
#include "bindings.hpp"

namespace radarsim::fmcw {

// Fill the power of spectra by the shape of the noise.
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

// Add cosines to the first samples of rows of sweeps; turns are in rad a sample.
inline bool add_cosines(Array<float, 2> sweeps, int64_t samples, Array<const int64_t> rows, Array<const double> turns,
                        Array<const double> phases, Array<const double> amplitudes) {
    // cos(a + b) = 2 cos(a) cos(b) - cos(a - b), with b of so many samples, which a processor computes at once. Over
    // the samples of a sweep the error stays below that of 32-bit numbers.
    constexpr int64_t LANES = 16;
    if (samples < 0 || samples > sweeps.shape[1]) return false;
    Buffer<double> tone(samples);
    for (int64_t k = 0; k < rows.size(); k++) {
        if (rows[k] < 0 || rows[k] >= sweeps.shape[0]) return false;
        for (int64_t n = 0; n < 2 * LANES && n < samples; n++) tone[n] = amplitudes[k] * cos(turns[k] * n + phases[k]);
        double factor = 2.0 * cos(LANES * turns[k]), *values = tone.data();
        for (int64_t n = 2 * LANES; n < samples; n++) values[n] = factor * values[n - LANES] - values[n - 2 * LANES];
        float* sweep = &sweeps(rows[k], 0);
        for (int64_t n = 0; n < samples; n++) sweep[n] += float(values[n]);
    }
    return true;
}
BIND(add_cosines, "rs k k k k")

// Find the strongest bin of each run of bins that are set: a strong echo sets all bins of its main lobe.
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

struct Neighbours { // the training bins on each side of a bin, half of all
    int64_t nearest, step, half;

    int64_t farthest() const { return nearest + (half - 1) * step; }
    bool is_valid() const {
        auto is_count = [](int64_t number) { return 1 <= number && number <= 1 << 20; };
        return is_count(nearest) && is_count(step) && is_count(half);
    }
};

// Find the bins that exceed the mean of their training bins by a factor: one if these are on one side, and one for
// both. Returns whether the training bins are valid.
inline int64_t find_ca(Array<const float, 2> power, int64_t nearest, int64_t step, int64_t half, double one_side,
                    double both_sides, Array<bool, 2> found) {
    Neighbours around = {nearest, step, half};
    if (!around.is_valid()) return false;
    int64_t count = power.shape[1], farthest = around.farthest(), length = count + nearest;
    // Sums over the training bins before each bin. Those after a bin are before one that is this much farther on,
    // which may be beyond the last.
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
        // Bins a step apart share all training bins but two.
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

// A histogram of levels, and how many are below the one that is current.
class LevelHistogram {
  public:
    void clear() { *this = {}; }
    void move(float value, int change) {
        int64_t level = value >= LEVELS ? LEVELS - 1 : value > 0.0f ? int64_t(value) : 0;
        counts_[level] += change;
        if (level < current_) below_ += change;
    }
    // The level of an order, which is at least 1 and at most the count; neighbours are mostly a few levels apart.
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

// Find the bins from one to another whose level is above that of an order around them. From a bin to the one a step
// farther on, two training bins change on each side; the histogram follows. Returns whether the numbers are valid.
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
                // On average the training bin was in the middle of its level.
                found(row, i) = line[i] > double(histogram.find(order)) + 0.5 + above;
            }
        }
    }
    return true;
}
BIND(find_os, "rb rb")

} // namespace radarsim::fmcw
