// Adds the echoes of surfaces, of grazed ground and of volumes to the power in range bins; see scattering.py for the
// theory.
//
// A grazed surface extends over several bins, since the next ray of the beam meets it farther away: its power is
// spread over this distance. Rays meet level ground at points metres apart. If the antenna is at height h above the
// ground, an interval d theta of elevation has its echoes in an interval of ranges
//
//     dR = R^2 / h sqrt(1 - h^2 / R^2) d theta.
//
// A volume adds power to every bin that the ray passes, decreasing as the volume absorbs the wave.
#pragma once
#include "attenuation.hpp"

namespace radarsim::fmcw {

constexpr double RELIEF_STEP = 0.25; // m, distance between the heights of uneven ground
constexpr double FARTHEST = 1e5;     // m, maximum distance at which ground is treated as uneven
constexpr double LEVEL = 1e-6;       // maximum deviation of a cosine for ground that counts as level

struct PartScattering { // a row for a part; the fields are described in scattering.py
    double gamma, glint, narrowness, area, volume, albedo, sway;
    double edges[4];     // m, minimum x and y, then maximum x and y of level ground
    bool constant_gamma; // gamma is the same at all angles, as for open ground; if not, it follows Lambert's law
};
ROW(PartScattering, gamma, glint, narrowness, area, volume, albedo, sway, edges, constant_gamma)

// Return the greatest integer that is not above a number; INT64_MIN if the number is too large or NaN.
inline int64_t floor_of(double number) { return whole_of(floor(number)); }

struct Scattering {
    Array<const PartScattering> parts; // the last row is for robots
    double air;                        // radar cross section of the air per volume, m^2/m^3
    int64_t open_part;                 // index of the largest part that is open ground; -1 for none
    double open_height, open_gamma;    // height of open_part, m, map frame, and its gamma
    Array<const double, 2> patches;    // gamma of open ground in each patch; empty if ground is the same everywhere
    Array<const double> corner;        // minimum x and y of the patches, m
    double cell;                       // side of a patch, m
    Array<const double, 2> relief;     // factor of the heights in each patch
    double open_relief;                // factor of the heights outside of the patches
    Array<const float, 2> heights;     // heights of uneven ground, m, a texture; its sides are powers of two

    bool has_patches() const { return patches.shape[0] && patches.shape[1]; }
    bool has_relief() const { return has_patches() && heights.shape[0] && heights.shape[1]; }
    // Return the value of a raster at a position, m; beyond for positions outside of the raster.
    double at(Array<const double, 2> raster, double x, double y, double beyond) const {
        int64_t i = floor_of((x - corner[0]) / cell), j = floor_of((y - corner[1]) / cell);
        bool is_within = 0 <= i && i < raster.shape[0] && 0 <= j && j < raster.shape[1];
        return is_within ? raster(i, j) : beyond;
    }
    // Return the height of uneven ground at a position, m; heights between the grid points are interpolated.
    double height_at(double x, double y) const {
        double u = x / RELIEF_STEP, v = y / RELIEF_STEP;
        int64_t i = floor_of(u), j = floor_of(v), last_i = heights.shape[0] - 1, last_j = heights.shape[1] - 1;
        auto row = [&](int64_t k) {
            double first = heights(k & last_i, j & last_j), second = heights(k & last_i, (j + 1) & last_j);
            return first + (v - j) * (second - first);
        };
        double near = row(i);
        return at(relief, x, y, open_relief) * (near + (u - i) * (row(i + 1) - near));
    }
    // Return the row of a part; all robots share the last row.
    const PartScattering& of(int64_t part) const {
        int64_t last = parts.size() - 1;
        return parts[part < 0 || part > last ? last : part];
    }
};
LAYOUT(Scattering, "p xy 2 xy hw", parts, air, open_part, open_height, open_gamma, patches, corner, cell, relief,
       open_relief, heights)

struct Grazing { // a ray that meets level ground
    double x, y;         // m, position of the antenna in the plan
    double ahead, left;  // x and y of the horizontal unit vector along the ray
    double t, depth;     // m, length of the ray, and height of the antenna above the ground
    double angle;        // rad, interval of elevations that the ray stands for
    double near, far;    // m, ranges at which the ground begins and ends
};

// Return the gamma of a surface at an angle of incidence with a positive cosine.
inline double gamma_at(double cosine, double gamma, bool constant_gamma, double glint, double narrowness) {
    double rough = constant_gamma ? gamma : gamma * cosine;
    if (glint <= 0.0) return rough;
    double square = cosine * cosine;
    double lobe = exp(-narrowness * (1.0 - square) / square);
    return rough + glint * lobe / (square * square * cosine);
}
BIND(gamma_at, "")

inline double surface_gamma(const PartScattering& part, double cosine) {
    return gamma_at(cosine, part.gamma, part.constant_gamma, part.glint, part.narrowness);
}

// The visible share of uneven ground in the azimuth of a column, step by step: rising ground hides the ground behind
// it. The share of a step is the angle in elevation that it covers, divided by the angle that level ground would cover.
class GroundView {
  public:
    explicit GroundView(double range) : shares_(floor_of(maximum(minimum(FARTHEST, range), 0.0) / RELIEF_STEP) + 2) {}
    void clear() { shares_.clear(); }
    // Compute the shares up to a distance, m, along the first ray of the column that meets ground.
    void look(const Scattering& scattering, const Grazing& grazing, double distance) {
        if (!scattering.has_relief() || is_above(grazing)) return;
        if (!shares_.size() || grazing.depth > first_.depth + SAME_LEVEL) {
            shares_.clear(); // roofs can be above the ground that later rays meet
            first_ = grazing, highest_ = -INFINITE, shares_.append(1.0);
        }
        for (int64_t step = shares_.size(); step < shares_.capacity() && (step - 1) * RELIEF_STEP < distance; step++) {
            double along = step * RELIEF_STEP;
            double height = scattering.height_at(first_.x + along * first_.ahead, first_.y + along * first_.left);
            double slope = (height - first_.depth) / along, level = first_.depth / (along * (step - 1));
            shares_.append(step > 1 ? maximum(slope - highest_, 0.0) / level : 1.0);
            highest_ = maximum(highest_, slope);
        }
    }
    // Return the share of the ground that a ray meets at a horizontal distance, m.
    double share(const Grazing& grazing, double along) const {
        int64_t step = floor_of(along / RELIEF_STEP) + 1;
        return 0 <= step && step < shares_.size() && !is_above(grazing) ? shares_[step] : 1.0;
    }

  private:
    static constexpr double SAME_LEVEL = 0.01; // m

    bool is_above(const Grazing& grazing) const {
        return shares_.size() && grazing.depth < first_.depth - SAME_LEVEL;
    }

    List<double> shares_;
    Grazing first_;
    double highest_; // greatest slope from the antenna to the ground up to the last step
};

// Return the gamma of the patch at a distance along a ray, m, times the visible share of the ground.
inline double patch_gamma(const Scattering& scattering, const GroundView& view, const Grazing& grazing,
                          double distance) {
    double along = sqrt(maximum(distance * distance - grazing.depth * grazing.depth, 0.0));
    double x = grazing.x + along * grazing.ahead, y = grazing.y + along * grazing.left;
    return scattering.at(scattering.patches, x, y, scattering.open_gamma) * view.share(grazing, along);
}

// Whether a surface is level; it is given by the direction and the cosine of incidence of a ray from above.
inline bool is_level(const Vector& direction, double cosine) { return fabs(cosine + direction[2]) < LEVEL; }

// Return a ray of length t, m, from a position above level ground.
inline Grazing over_ground(double x, double y, const Vector& direction, double t, double angle, double near,
                           double far) {
    double level = maximum(hypot(direction[0], direction[1]), 1e-9);
    return {x, y, direction[0] / level, direction[1] / level, t, -t * direction[2], angle, near, far};
}

// Return a ray that meets a part's level ground at an event; objects hide the ground beyond the range end, m.
inline Grazing grazing_at(const PartScattering& part, const Event& event, const Vector& direction, double angle,
                          double end) {
    double back = INFINITE, ahead = INFINITE;
    auto cut = [&](double step, double place, double low, double high) {
        if (fabs(step) <= 1e-9) return;
        double first = (low - place) / step, second = (high - place) / step;
        back = minimum(back, -minimum(first, second));
        ahead = minimum(ahead, maximum(first, second));
    };
    cut(direction[0], event.x, part.edges[0], part.edges[2]);
    cut(direction[1], event.y, part.edges[1], part.edges[3]);
    double t = event.t, near = t - maximum(back, 0.0), far = minimum(t + maximum(ahead, 0.0), end);
    return over_ground(event.x - t * direction[0], event.y - t * direction[1], direction, t, angle, near, far);
}

constexpr double NEPER_DB = 4.3429448190325175; // dB of power in a neper of power
constexpr double STEEPEST = 0.999;             // maximum of (h / R)^2 in the formula for ground
constexpr double NEAREST = 0.3;                // m; at shorter ranges the far field, and 1 / R^2, are not valid

struct RangeLines { // power by range of two columns: odd and even columns use one line each
    double bin_size;                // m; bin b extends from b - 1/2 to b + 1/2 times this size
    Array<const double> per_square; // 1 / R^2 of each bin, 1/m^2; 0 for bins nearer than NEAREST
    Array<float, 2> power;
    // Power of objects that the wind moves, and this power times their rms speed, m/s; no bins if nothing moves.
    Array<float, 3> sway;
    Array<int64_t, 2> spans; // the first and the last bin with power of each line

    int64_t count() const { return per_square.size(); }
    double bin_at(double range) const { return range / bin_size + 0.5; }
    // Extend the spans of both lines to bins that now have power.
    void widen(int64_t low, int64_t high) const {
        for (int64_t line = 0; line < 2; line++) {
            if (low < spans(line, 0)) spans(line, 0) = low;
            if (high > spans(line, 1)) spans(line, 1) = high;
        }
    }
};
LAYOUT(RangeLines, "b 2b 22s 22", bin_size, per_square, power, sway, spans)

struct Place { // how the power of a ray is added to the lines
    int64_t here;  // line of the ray's column
    double across; // share of the power for the next column
    double weight; // power from a gamma of 1 at 1 m
    double shift;  // m, added to ranges
    double sway;   // rms speed at which the wind moves the object, m/s

    Place swaying(double speed) const { return {here, across, weight, shift, speed}; }
};

struct Span { // an interval of ranges, in bins, and the bins that it overlaps; none if high is below low
    double start, end;
    int64_t low, high;

    Span(double start, double end, int64_t count) : start(start), end(end), low(floor_of(start)), high(floor_of(end)) {
        if (low < 0) low = 0;
        if (high > count - 1) high = count - 1;
    }
    // Return the share of a bin that the interval covers.
    double share(int64_t bin) const { return minimum(end, bin + 1.0) - maximum(start, double(bin)); }
};

inline void add_to_bin(const RangeLines& lines, const Place& place, int64_t bin, double power) {
    int64_t rows[2] = {place.here, 1 - place.here};
    double shares[2] = {power * (1.0 - place.across), power * place.across};
    for (int i = 0; i < 2; i++) {
        float& own = lines.power(rows[i], bin);
        own = float(own + shares[i]);
        if (place.sway <= 0.0) continue;
        float &moved = lines.sway(rows[i], 0, bin), &speed = lines.sway(rows[i], 1, bin);
        moved = float(moved + shares[i]);
        speed = float(speed + shares[i] * place.sway);
    }
}

// Add the echo of a surface at a distance, spread evenly over a length along the ray, at least over one bin: otherwise
// the power would jump from bin to bin as the radar moves. Gamma includes the losses on the path.
inline void add_surface(const RangeLines& lines, const Place& place, double t, double gamma, double length) {
    if (gamma <= 0.0 || t < NEAREST) return;
    double power = place.weight * gamma / (t * t), half = 0.5 * maximum(length, lines.bin_size);
    double middle = t + place.shift;
    Span span(lines.bin_at(middle - half), lines.bin_at(middle + half), lines.count());
    if (span.high < span.low) return;
    double density = power / (span.end - span.start);
    for (int64_t bin = span.low; bin <= span.high; bin++) add_to_bin(lines, place, bin, density * span.share(bin));
    lines.widen(span.low, span.high);
}

// Return the power of level ground in a bin whose 1 / R^2 is per_square.
inline double ground_at(double per_square, double depth, double scale) {
    double steep = minimum(depth * depth * per_square, STEEPEST);
    return scale * per_square * per_square / sqrt(1.0 - steep);
}

// Add power to the bins between the first and the last of a span, if the object does not sway. The function power_of
// returns the power of a bin; if it has no branches, the loop can be vectorised.
template <typename Power>
inline void fill_bins(const RangeLines& lines, const Place& place, const Span& span, Power power_of) {
    float *own = &lines.power(place.here, 0), *next = &lines.power(1 - place.here, 0);
    double across = place.across;
    for (int64_t bin = span.low + 1; bin < span.high; bin++) {
        double power = power_of(bin);
        own[bin] = float(own[bin] + power * (1.0 - across));
        next[bin] = float(next[bin] + power * across);
    }
}

// Add the echo of level ground. Gamma is the gamma of the point that the ray meets, including the losses on the path;
// for ground with patches it is only the losses.
inline void add_ground(const RangeLines& lines, const Place& place, const Grazing& grazing, double gamma,
                       bool constant_gamma, const Scattering& scattering, GroundView& view) {
    bool is_patched = constant_gamma && scattering.has_patches();
    double t = grazing.t, depth = grazing.depth, size = lines.bin_size, shift = place.shift;
    // The ray stands for an interval of elevations with its own elevation in the middle.
    double here = asin(minimum(depth / t, 1.0)), half = 0.5 * grazing.angle;
    // Elevations are limited to 1.5 rad, since beyond straight down (1.57 rad) ranges would increase again.
    double start = maximum(depth / sin(minimum(here + half, 1.5)), grazing.near, NEAREST), end = grazing.far;
    // If here is not above half, the interval reaches the horizon, where directions meet no ground.
    if (here > half) end = minimum(end, depth / sin(here - half));
    if (is_patched) view.look(scattering, grazing, end);
    // The power is distributed over this angle; the power beyond the last bin is lost.
    double angle = asin(minimum(depth / start, 1.0)) - asin(minimum(depth / end, 1.0));
    double last = minimum(lines.bin_at(end + shift), double(lines.count()));
    Span span(lines.bin_at(start + shift), last, lines.count());
    if (span.high < span.low || angle <= 0.0) return;
    double scale = place.weight * gamma * depth * size / angle;
    lines.widen(span.low, span.high);
    // By Lambert's law gamma is proportional to h / R; the given gamma is for the range of the ray, t.
    auto lambert = [&](int64_t, double per_square) { return t * sqrt(per_square); };
    auto patched = [&](double range) { return patch_gamma(scattering, view, grazing, range); };
    // The span covers the first and the last bin only partly.
    const int64_t ends[] = {span.low, span.high};
    for (int64_t bin : ends) {
        double per_square = lines.per_square[bin], power = ground_at(per_square, depth, scale * span.share(bin));
        if (!constant_gamma) power *= lambert(bin, per_square);
        else if (is_patched) power *= patched(bin * size - shift);
        add_to_bin(lines, place, bin, power);
    }
    double second = (span.low + 1) * size - shift;
    auto patched_from = [&](int64_t bin, double) { return patched(second + (bin - span.low - 1) * size); };
    auto fill = [&](auto gamma_of) {
        fill_bins(lines, place, span, [=, squares = lines.per_square.data](int64_t bin) {
            return ground_at(squares[bin], depth, scale) * gamma_of(bin, squares[bin]);
        });
    };
    if (!constant_gamma) fill(lambert);
    else if (is_patched) fill(patched_from);
    else fill([](int64_t, double) { return 1.0; });
}

// Return the integral of e^(-rate r) for r from 0 to depth.
inline double mean_depth(double rate, double depth) {
    if (rate * depth < 1e-6) return depth; // the difference below would have too few digits
    return (1.0 - exp(-rate * depth)) / rate;
}

// Add the echo of a volume along the path of a ray through it; volume is its radar cross section per volume, m^2/m^3.
// Loss is the one-way loss up to the volume, dB, and slope the one-way loss per metre in it, dB/m.
inline void add_volume(const RangeLines& lines, const Place& place, double near, double far, double volume,
                       double loss, double slope) {
    double size = lines.bin_size, rate = 2.0 * slope / NEPER_DB; // two-way nepers of power per metre
    Span span(lines.bin_at(near + place.shift), lines.bin_at(far + place.shift), lines.count());
    if (span.high < span.low) return;
    // The ray passes all bins completely except the first and the last, so their factor is computed once.
    double fade = exp(-rate * size), whole = mean_depth(rate, size), begin = maximum(span.start, double(span.low));
    double left = place.weight * volume * pow(10.0, -0.2 * loss);
    left *= exp(-rate * (begin - span.start) * size);
    auto pass_bin = [&](int64_t bin) {
        double returned = left * whole * lines.per_square[bin];
        return left *= fade, returned;
    };
    auto add_end = [&](int64_t bin) {
        double depth = (minimum(span.end, bin + 1.0) - begin) * size;
        if (depth >= 0.999999 * size) return add_to_bin(lines, place, bin, pass_bin(bin));
        add_to_bin(lines, place, bin, left * mean_depth(rate, depth) * lines.per_square[bin]);
        left *= exp(-rate * depth);
    };
    add_end(span.low);
    if (place.sway <= 0.0) fill_bins(lines, place, span, pass_bin);
    else for (int64_t bin = span.low + 1; bin < span.high; bin++) add_to_bin(lines, place, bin, pass_bin(bin));
    begin = double(span.high);
    if (span.low < span.high) add_end(span.high);
    lines.widen(span.low, span.high);
}

} // namespace radarsim::fmcw
