// Sweeps and their spectra; see beat_signal.py for the theory.
#pragma once
#include "door.hpp"

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
DOOR(square_spectra, "rs b rb")

// Add cosines to the first samples of rows of sweeps; turns are in rad a sample.
inline bool add_cosines(Array<float, 2> sweeps, int64_t samples, Array<const int64_t> rows, Array<const double> turns,
                        Array<const double> phases, Array<const double> amplitudes) {
    // cos(a + b) = 2 cos(a) cos(b) - cos(a - b), with b of so many samples, which a processor computes at once. Over
    // the samples of a sweep the error stays below that of 32-bit numbers.
    constexpr int64_t LANES = 16;
    if (samples < 0 || samples > sweeps.shape[1]) return false;
    Room<double> tone(samples);
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
DOOR(add_cosines, "rs k k k k")

} // namespace radarsim::fmcw
