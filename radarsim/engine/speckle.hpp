// The amplitudes of what is rough; see speckle.py for the theory.
#pragma once
#include "scattering.hpp"

namespace radarsim::fmcw {

constexpr float FAINT = 1e-5f; // in units of the noise; what is less has no amplitude
constexpr int64_t HASH_LEVELS = 1024;

struct HashLevel { // what one of the levels of a hash stands for
    float amplitude;       // of a mean power of 1 and exponential distribution
    float real, imaginary; // of a unit vector
    float speed;           // standard normal
};
LAYOUT(HashLevel, "", amplitude, real, imaginary, speed)

struct Scatterers { // those of a column of the fan, as an antenna sees them
    uint64_t key;   // of the hash
    int64_t start;  // number of the scatterer in the first bin
    uint64_t phase; // in levels
    double drift;   // by how many levels the phase turns of a scatterer of 1 m/s
};
LAYOUT(Scatterers, "", key, start, phase, drift)

// A hash of a word, by the generator SplitMix64 (Steele, Lea and Flood, 2014).
constexpr uint64_t HASH_STEP = 0x9E3779B97F4A7C15;
inline uint64_t mixed(uint64_t word) {
    word = (word ^ (word >> 30)) * 0xBF58476D1CE4E5B9;
    word = (word ^ (word >> 27)) * 0x94D049BB133111EB;
    return word ^ (word >> 31);
}

// Fill the amplitudes, real and imaginary parts, of neighbouring bins from one on, by their mean power. Of that moved
// is what the wind moves, and speed that times its rms speed, m/s; null if it moves nothing.
inline void fill_amplitudes(const Scatterers& scatterers, Array<const HashLevel> levels, int64_t first, int64_t count,
                            const float* power, const float* moved, const float* speed, float* amplitudes) {
    constexpr uint64_t LAST = HASH_LEVELS - 1;
    for (int64_t i = 0; i < count; i++) {
        amplitudes[2 * i] = amplitudes[2 * i + 1] = 0.0f;
        if (power[i] <= FAINT) continue;
        uint64_t word = mixed(scatterers.key + (uint64_t(scatterers.start) + uint64_t(first + i)) * HASH_STEP);
        float size = sqrtf(power[i]) * levels[word & LAST].amplitude;
        uint64_t turned = (word >> 10) + scatterers.phase;
        if (moved && moved[i] > 0.0f) {
            // Of all scatterers as many move as the share of the power that does.
            double share = double(word >> 30) / 0x1p34;
            if (share * power[i] < moved[i]) {
                double rms = scatterers.drift * levels[(word >> 20) & LAST].speed * speed[i] / moved[i];
                turned += uint64_t(floor_of(rms));
            }
        }
        amplitudes[2 * i] = size * levels[turned & LAST].real;
        amplitudes[2 * i + 1] = size * levels[turned & LAST].imaginary;
    }
}

// Add the amplitudes of the same mean power in several directions. Returns whether the levels are complete.
inline bool add_amplitudes(Array<const Scatterers> scatterers, Array<const HashLevel> levels, Array<const float> power,
                           Array<float[2], 2> field) {
    if (levels.size() != HASH_LEVELS) return false;
    int64_t count = power.size();
    Room<float> amplitudes(2 * count);
    for (int64_t row = 0; row < scatterers.size(); row++) {
        fill_amplitudes(scatterers[row], levels, 0, count, power.data, nullptr, nullptr, amplitudes.data());
        float* own = field.data[row * count];
        for (int64_t i = 0; i < 2 * count; i++) own[i] += amplitudes[i];
    }
    return true;
}
DOOR(add_amplitudes, "n l b nb")

} // namespace radarsim::fmcw
