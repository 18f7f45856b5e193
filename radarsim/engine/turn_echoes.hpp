// The echoes of a revolution: mean power and amplitude by azimuth and range bin; see turn_echoes.py, and speckle.py
// for the amplitudes.
#pragma once
#include "ray_power.hpp"
#include <cpuid.h>

namespace radarsim::fmcw {

constexpr float FAINT = 1e-5f; // in units of the noise; bins with less power get no amplitude
constexpr float BRIGHT = 10.0f;  // in units of the noise; bins with less power are added only to main lobes
constexpr double SHOULDER = 2e-3; // two-way pattern; where it is weaker, only bins brighter than BRIGHT are added
constexpr int64_t HASH_LEVELS = 1024;
constexpr double TEXTURE_CELL = 0.25; // m, side of a cell of the texture; a power of two

struct HashLevel { // the random numbers for one of the levels of a hash
    float amplitude;       // square root of an exponentially distributed power with mean 1
    float real, imaginary; // unit vector of the phase
    float speed;           // standard normal
};
ROW(HashLevel, amplitude, real, imaginary, speed)

struct Scatterers { // the scatterers in a column of the fan, as seen from an antenna
    uint64_t key;   // key of the hash
    int64_t start;  // number of the scatterer in the first bin
    uint64_t phase; // phase, in hash levels
    double drift;   // change of the phase of a scatterer that moves at 1 m/s, in hash levels
    double x, y, dx, dy; // position of the first bin, and step from bin to bin, in cells of the texture
};
ROW(Scatterers, key, start, phase, drift, x, y, dx, dy)

// Return the factor of the power in a bin from a repeated texture, whose sides are powers of two.
inline float texture_at(const Scatterers& scatterers, Array<const float, 2> texture, int64_t bin) {
    int64_t i = floor_of(scatterers.x + bin * scatterers.dx), j = floor_of(scatterers.y + bin * scatterers.dy);
    return texture(i & (texture.shape[0] - 1), j & (texture.shape[1] - 1));
}

// Hash of a word: the mixing function of the random generator SplitMix64 (Steele, Lea and Flood, 2014).
constexpr uint64_t HASH_STEP = 0x9E3779B97F4A7C15;
inline uint64_t mixed(uint64_t word) {
    word = (word ^ (word >> 30)) * 0xBF58476D1CE4E5B9;
    word = (word ^ (word >> 27)) * 0x94D049BB133111EB;
    return word ^ (word >> 31);
}

// Find the scatterers at azimuths, which are given by their cosines and negative sines; see speckle.py. The value
// which[i] is the index of the viewpoint at azimuth i. The array turns has the cosine and the sine of the angle of each
// direction, with angle 0 in the middle. Keys are the first key of the hash, and the first cell of the texture. Returns
// whether all indices are valid.
inline bool find_scatterers(Array<const double[2]> azimuths, Array<const int64_t> which, Array<const Vector> positions,
                            Array<const Vector[3]> rotations, Array<const Vector> velocities, Array<const double> times,
                            Array<const double[2]> turns, int64_t directions, double width, double repeat,
                            double bin_size, double wavelength, double per_speed, double tone,
                            Array<const uint64_t> keys, Array<Scatterers> found) {
    for (int64_t i = 0; i < found.size(); i++) {
        if (which[i] < 0 || which[i] >= times.size()) return false;
        const Vector &place = positions[which[i]], &velocity = velocities[which[i]];
        const auto& rows = rotations[which[i]];
        Vector ahead;
        for (int j = 0; j < 3; j++) ahead[j] = rows[j][0] * azimuths[i][0] + rows[j][1] * azimuths[i][1];
        int64_t number = whole_of(rint(atan2(ahead[1], ahead[0]) / width)), middle = turns.size() / 2;
        if (number < -middle || number >= turns.size() - middle) return false;
        auto& [x, y, z] = place.numbers;
        auto& [cosine, sine] = turns[number + middle];
        double along = x * cosine + y * sine, beside = y * cosine - x * sine;
        uint64_t key = mixed(keys[0] + uint64_t(number) + (number < 0 ? uint64_t(directions) : 0));
        // While the antenna moves, the scatterers of each direction are replaced at different positions, so that not
        // all sets change at once.
        key = mixed(key + HASH_STEP * uint64_t(floor_of(beside / repeat + double(key) / 0x1p64)));
        // The order of the sum is that of numpy.einsum, which computed it before.
        double speed = ahead[0] * velocity[0] + ahead[2] * velocity[2] + ahead[1] * velocity[1];
        double shift = per_speed * speed, start = rint((along - shift) / bin_size);
        // The phase is given for the middle of the sweep. It includes the phase that the beat component accumulates
        // until then.
        double phase = start * tone - 2.0 * along / wavelength, step = bin_size / TEXTURE_CELL;
        found[i] = {key, whole_of(start), uint64_t(floor_of((phase - floor(phase)) * HASH_LEVELS)) % HASH_LEVELS,
                    2.0 * HASH_LEVELS * times[which[i]] / wavelength, (x - shift * cosine) / TEXTURE_CELL + keys[1],
                    (y - shift * sine) / TEXTURE_CELL + keys[2], cosine * step, sine * step};
    }
    return true;
}
BIND(find_scatterers, "n n v v v v t 3 n")

// Compute the amplitudes of consecutive bins, real and imaginary parts, from their mean power. Moved is the power of
// objects that the wind moves, and speed is moved times their rms speed, m/s; both are null if nothing moves.
inline void fill_amplitudes(const Scatterers& scatterers, Array<const HashLevel> levels, Array<const float, 2> texture,
                            int64_t first, int64_t count, const float* power, const float* moved, const float* speed,
                            float* amplitudes) {
    constexpr uint64_t LAST = HASH_LEVELS - 1;
    bool has_texture = texture.shape[0] && texture.shape[1];
    for (int64_t i = 0; i < count; i++) {
        amplitudes[2 * i] = amplitudes[2 * i + 1] = 0.0f;
        if (power[i] <= FAINT) continue;
        uint64_t word = mixed(scatterers.key + (uint64_t(scatterers.start) + uint64_t(first + i)) * HASH_STEP);
        float local = has_texture ? power[i] * texture_at(scatterers, texture, first + i) : power[i];
        float size = sqrtf(local) * levels[word & LAST].amplitude;
        uint64_t turned = (word >> 10) + scatterers.phase;
        if (moved && moved[i] > 0.0f) {
            // The share of scatterers that move equals the share of the power from moving objects.
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

// Add amplitudes to several rows that have the same mean power by bin. Returns whether the levels are complete.
inline bool add_amplitudes(Array<const Scatterers> scatterers, Array<const HashLevel> levels, Array<const float> power,
                           Array<float[2], 2> field) {
    if (levels.size() != HASH_LEVELS) return false;
    int64_t count = power.size();
    Buffer<float> amplitudes(2 * count);
    for (int64_t row = 0; row < scatterers.size(); row++) {
        fill_amplitudes(scatterers[row], levels, {}, 0, count, power.data, nullptr, nullptr, amplitudes.data());
        float* own = field.data[row * count];
        for (int64_t i = 0; i < 2 * count; i++) own[i] += amplitudes[i];
    }
    return true;
}
BIND(add_amplitudes, "n l b nb")

struct Beams { // the sums of the echoes of a revolution
    // Mean power by azimuth; the first row is half of the pattern's width before the first azimuth.
    Array<float, 2> power;
    Array<float[2], 2> field; // amplitudes in the same rows, real and imaginary parts
    Array<double> total;      // sum of the power of all columns
    Array<const double, 2> pattern; // from pattern_table in antenna.py
    Array<const float, 2> texture;  // factors of the power by position; empty for none
    Array<float[2]> amplitudes;     // memory for intermediate results
};
LAYOUT(Beams, "db db b fk xy b", power, field, total, pattern, texture, amplitudes)

// Add the echoes of a column to the azimuths whose beams cover it, and clear the column's line.
__attribute__((always_inline)) inline void spread_line(const Beams& beams, const RangeLines& lines,
                                                       const Scatterers& scatterers, Array<const HashLevel> levels,
                                                       int64_t column) {
    int64_t here = column & 1, low = lines.spans(here, 0), high = lines.spans(here, 1);
    if (high < low) return;
    int64_t parts = beams.pattern.shape[0], count = high - low + 1;
    float *line = &lines.power(here, low), *amplitudes = beams.amplitudes[low];
    float *moved = nullptr, *speed = nullptr;
    if (lines.sway.shape[2]) moved = &lines.sway(here, 0, low), speed = &lines.sway(here, 1, low);
    fill_amplitudes(scatterers, levels, beams.texture, low, count, line, moved, speed, amplitudes);
    List<int64_t> bright(count);
    for (int64_t i = 0; i < count; i++)
        if (line[i] > BRIGHT) bright.append(i);
    for (int64_t k = 0; k < beams.pattern.shape[1]; k++) {
        double pattern = beams.pattern(column % parts, k);
        float gain = float(pattern), field_gain = float(sqrt(pattern));
        float *power = &beams.power(column / parts + k, low), *field = beams.field(column / parts + k, low);
        if (pattern < SHOULDER) {
            for (int64_t i : bright) {
                power[i] += gain * line[i];
                for (int64_t j = 2 * i; j < 2 * i + 2; j++) field[j] += field_gain * amplitudes[j];
            }
            continue;
        }
        for (int64_t i = 0; i < count; i++) power[i] += gain * line[i];
        for (int64_t i = 0; i < 2 * count; i++) field[i] += field_gain * amplitudes[i];
    }
    for (int64_t i = 0; i < count; i++) beams.total[low + i] += line[i];
    memset(line, 0, count * sizeof(float));
    if (moved) memset(moved, 0, count * sizeof(float)), memset(speed, 0, count * sizeof(float));
    lines.spans(here, 0) = lines.count(), lines.spans(here, 1) = -1;
}

// This is spread_line compiled for AVX2, which adds eight numbers at once, since it takes most of the time of a
// revolution.
__attribute__((target("avx2"))) inline void spread_line_by_eights(const Beams& beams, const RangeLines& lines,
                                                                  const Scatterers& scatterers,
                                                                  Array<const HashLevel> levels, int64_t column) {
    spread_line(beams, lines, scatterers, levels, column);
}

// Whether the processor and the operating system support AVX2.
inline bool has_avx2() {
    uint32_t a, b, c, d, states = 0;
    if (__get_cpuid(1, &a, &b, &c, &d) && c & bit_OSXSAVE) __asm__("xgetbv" : "=a"(states) : "c"(0) : "edx");
    return (states & 6) == 6 && __get_cpuid_count(7, 0, &a, &b, &c, &d) && b & bit_AVX2;
}

// Add the echoes of the rays of some columns. Scatterers has a row for each column, and a row for the column after
// the last. Closes is true if that column belongs to the next revolution. Returns whether the arguments are valid.
inline bool add_rays(const Beams& beams, const RangeLines& lines, const FanRays& rays, Array<const Event> events,
                     const Scattering& scattering, Array<const Scatterers> scatterers, Array<const HashLevel> levels,
                     int64_t first, bool closes) {
    int64_t columns = scatterers.size() - 1, parts = beams.pattern.shape[0], bins = lines.count();
    auto is_span = [&](int64_t line) { return lines.spans(line, 0) >= 0 && lines.spans(line, 1) < bins; };
    bool fits = columns >= 0 && parts > 0 && first >= 0 && first <= INT64_MAX / 2 && levels.size() == HASH_LEVELS &&
                (first + columns) / parts + beams.pattern.shape[1] <= beams.power.shape[0] &&
                beams.total.size() == bins && (lines.sway.shape[2] == bins || !lines.sway.shape[2]) && is_span(0) &&
                is_span(1) && scattering.parts.size() && scattering.open_part < scattering.parts.size() &&
                !(events.size() && events[events.size() - 1].kind == Kind::MIRRORED);
    if (!fits) return false;
    for (const PartScattering& part : scattering.parts)
        if (!lines.sway.shape[2] && !(part.sway <= 0.0)) return false;
    List<int64_t> inside(scattering.parts.size());
    GroundView view(bins * lines.bin_size);
    int64_t ray = 0, event = 0;
    auto spread = has_avx2() ? spread_line_by_eights : spread_line;
    // Rays add power to their column and to the next one, so two lines are enough: when a column is complete, its line
    // is added to the beams, cleared, and reused for the column after the next.
    for (int64_t i = 0; i < columns; i++) {
        view.clear();
        for (; ray < rays.column.size() && rays.column[ray] == first + i; ray++)
            event = RayWalk(rays, events, scattering, lines, view, inside, ray, event).add();
        spread(beams, lines, scatterers[i], levels, first + i);
    }
    if (closes) spread(beams, lines, scatterers[columns], levels, first + columns);
    return true;
}
BIND(add_rays, "e s l")

} // namespace radarsim::fmcw
