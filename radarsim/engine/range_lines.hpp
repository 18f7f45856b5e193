// What the surfaces of a scene scatter back, and the ground that rays graze; see scattering.py for the theory.
// And power by range: where a ray adds what comes back along it.
//
// A surface that is grazed takes up more than one bin, as the next ray of the beam meets it farther off: its power is
// spread over that distance. From level ground at a depth h below the antenna, which rays meet metres apart,
// elevations of d theta return at ranges
//
//     dR = R^2 / h sqrt(1 - h^2 / R^2) d theta.
//
// A volume adds to every bin that the ray passes, less and less as it takes from the wave.
#pragma once
#include "attenuation.hpp"

namespace radarsim::fmcw {

constexpr double RELIEF_STEP = 0.25; // m, between heights of uneven ground
constexpr double FARTHEST = 1e5;     // m, as far as which uneven ground is looked at
constexpr double LEVEL = 1e-6;       // how far the normal of level ground is off the vertical, at most

struct PartScattering { // a row of scattering.py
    double gamma, glint, narrowness, area, volume, albedo, sway;
    double edges[4];     // m, where level ground ends: least x, y and greatest ones
    bool constant_gamma; // at all angles, as that of open ground; else it follows Lambert's law
};
ROW(PartScattering, gamma, glint, narrowness, area, volume, albedo, sway, edges, constant_gamma)

// The greatest integer up to a number; the least of all integers where there is none.
inline int64_t floor_of(double number) { return whole_of(floor(number)); }

struct Scattering {
    Array<const PartScattering> parts; // the last row is that of robots
    double air;                        // cross section of a cubic metre of the air, m^2/m^3
    int64_t open_part;                 // the part that is open ground; -1 for none
    double open_height, open_gamma;    // m, map frame; and its gamma
    Array<const double, 2> patches;    // gamma of open ground by place, if it is not that of open_part everywhere
    Array<const double> corner;        // m, least x and y of these
    double cell;                       // m, side of a patch
    Array<const double, 2> relief;     // by which heights are multiplied in each patch
    double open_relief;                // likewise beyond
    Array<const float, 2> heights;     // m, of uneven ground, which are repeated; sides are powers of two

    bool has_patches() const { return patches.shape[0] && patches.shape[1]; }
    bool has_relief() const { return has_patches() && heights.shape[0] && heights.shape[1]; }
    // The value of a raster at a place, m; another one beyond its edges.
    double at(Array<const double, 2> raster, double x, double y, double beyond) const {
        int64_t i = floor_of((x - corner[0]) / cell), j = floor_of((y - corner[1]) / cell);
        bool is_within = 0 <= i && i < raster.shape[0] && 0 <= j && j < raster.shape[1];
        return is_within ? raster(i, j) : beyond;
    }
    // The height of uneven ground at a place, m.
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
    // The row of a part; robots share the last.
    const PartScattering& of(int64_t part) const {
        int64_t last = parts.size() - 1;
        return parts[part < 0 || part > last ? last : part];
    }
};
LAYOUT(Scattering, "p xy 2 xy hw", parts, air, open_part, open_height, open_gamma, patches, corner, cell, relief,
       open_relief, heights)

struct Grazing { // a ray that meets level ground
    double x, y;         // m, of the place above which it starts
    double ahead, left;  // parts of its direction along x and y, of a level unit vector
    double t, depth;     // m, its length; and from the antenna down to the ground
    double angle;        // rad, of elevations for which it stands
    double near, far;    // m, ranges at which the ground begins and ends
};

// The gamma of a surface at an angle of incidence, whose cosine is above 0.
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

// How much of uneven ground an antenna sees in one direction, step by step: what rises hides what is behind it. The
// shares of its view that steps fill are relative to those of level ground, so that the whole view is always full.
class GroundView {
  public:
    explicit GroundView(double range) : shares_(floor_of(maximum(minimum(FARTHEST, range), 0.0) / RELIEF_STEP) + 2) {}
    void clear() { shares_.clear(); }
    // Look as far as a distance, m, along the first ray that meets ground in this direction.
    void look(const Scattering& scattering, const Grazing& grazing, double distance) {
        if (!scattering.has_relief()) return;
        if (!shares_.size()) first_ = grazing, highest_ = -INFINITE, shares_.append(1.0);
        for (int64_t step = shares_.size(); step < shares_.capacity() && (step - 1) * RELIEF_STEP < distance; step++) {
            double along = step * RELIEF_STEP;
            double height = scattering.height_at(first_.x + along * first_.ahead, first_.y + along * first_.left);
            double slope = (height - first_.depth) / along, level = first_.depth / (along * (step - 1));
            shares_.append(step > 1 ? maximum(slope - highest_, 0.0) / level : 1.0);
            highest_ = maximum(highest_, slope);
        }
    }
    // The share that the ground has in a distance on the level, m.
    double share(double along) const {
        int64_t step = floor_of(along / RELIEF_STEP) + 1;
        return 0 <= step && step < shares_.size() ? shares_[step] : 1.0;
    }

  private:
    List<double> shares_;
    Grazing first_;
    double highest_; // slope at which the antenna looks over all so far
};

// The gamma of patched ground at a distance along a ray, m, as far as it is seen.
inline double patch_gamma(const Scattering& scattering, const GroundView& view, const Grazing& grazing,
                          double distance) {
    double along = sqrt(maximum(distance * distance - grazing.depth * grazing.depth, 0.0));
    double x = grazing.x + along * grazing.ahead, y = grazing.y + along * grazing.left;
    return scattering.at(scattering.patches, x, y, scattering.open_gamma) * view.share(along);
}

// Whether a surface is level that a ray from above meets at an angle of incidence.
inline bool is_level(const Vector& direction, double cosine) { return fabs(cosine + direction[2]) < LEVEL; }

// A ray of length t from a place over level ground.
inline Grazing over_ground(double x, double y, const Vector& direction, double t, double angle, double near,
                           double far) {
    double level = maximum(hypot(direction[0], direction[1]), 1e-9);
    return {x, y, direction[0] / level, direction[1] / level, t, -t * direction[2], angle, near, far};
}

// A ray that meets level ground of a part at an event; the view over the ground ends at a distance.
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
constexpr double STEEPEST = 0.999;             // square of h / R, at which the formula for ground ends
constexpr double NEAREST = 0.3;                // m; nearer the far field, and 1 / R^2, do not hold

struct RangeLines { // power by range, of one column and the next, which take turns
    double bin_size;                // m; bin b is from b - 1/2 to b + 1/2 of it
    Array<const double> per_square; // 1 / R^2 of each bin, 1/m^2; 0 where it is too near
    Array<float, 2> power;
    // What the wind moves, without bins if nothing does: its power, and that times its rms speed, m/s.
    Array<float, 3> sway;
    Array<int64_t, 2> spans; // of each line the first and the last bin with power

    int64_t count() const { return per_square.size(); }
    double bin_at(double range) const { return range / bin_size + 0.5; }
    // Note that bins have power.
    void widen(int64_t low, int64_t high) const {
        for (int64_t line = 0; line < 2; line++) {
            if (low < spans(line, 0)) spans(line, 0) = low;
            if (high > spans(line, 1)) spans(line, 1) = high;
        }
    }
};
LAYOUT(RangeLines, "b 2b 22s 22", bin_size, per_square, power, sway, spans)

struct Place { // where a ray's power goes
    int64_t here;  // the line of its column
    double across; // the share of the next column
    double weight; // power at 1 m from a gamma of 1
    double shift;  // m, added to ranges
    double sway;   // rms speed at which the wind moves what returns it, m/s

    Place swaying(double speed) const { return {here, across, weight, shift, speed}; }
};

struct Span { // of ranges, in bins, and which bins it touches; none if high is below low
    double start, end;
    int64_t low, high;

    Span(double start, double end, int64_t count) : start(start), end(end), low(floor_of(start)), high(floor_of(end)) {
        if (low < 0) low = 0;
        if (high > count - 1) high = count - 1;
    }
    // Which part of a bin it covers.
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

// Add what a surface at a distance returns, evenly over a length along the ray, and at least over one bin: else its
// power would jump from one to the next as the radar moves. Gamma is less the losses on the way.
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

// What level ground returns into a bin of 1 / R^2.
inline double ground_at(double per_square, double depth, double scale) {
    double steep = minimum(depth * depth * per_square, STEEPEST);
    return scale * per_square * per_square / sqrt(1.0 - steep);
}

// Add ground to the whole bins between two; gamma_of has the rest of its gamma by bin and 1 / R^2. Without choices in
// that, a processor computes several bins at once.
template <typename Gamma>
inline void fill_ground(const RangeLines& lines, const Place& place, const Span& span, double depth, double scale,
                        Gamma gamma_of) {
    float *own = &lines.power(place.here, 0), *next = &lines.power(1 - place.here, 0);
    const double* per_square = lines.per_square.data;
    double across = place.across;
    for (int64_t bin = span.low + 1; bin < span.high; bin++) {
        double power = ground_at(per_square[bin], depth, scale) * gamma_of(bin, per_square[bin]);
        own[bin] = float(own[bin] + power * (1.0 - across));
        next[bin] = float(next[bin] + power * across);
    }
}

// Add what level ground returns. Gamma is that where the ray meets it, less the losses on the way; only these losses
// if it is of patches.
inline void add_ground(const RangeLines& lines, const Place& place, const Grazing& grazing, double gamma,
                       bool constant_gamma, const Scattering& scattering, GroundView& view) {
    bool is_patched = constant_gamma && scattering.has_patches();
    double t = grazing.t, depth = grazing.depth, size = lines.bin_size, shift = place.shift;
    // The ray stands for elevations of half the angle to either side of its own.
    double here = asin(minimum(depth / t, 1.0)), half = 0.5 * grazing.angle;
    // Beyond straight down, 1.57 rad, ranges would grow again.
    double start = maximum(depth / sin(minimum(here + half, 1.5)), grazing.near, NEAREST), end = grazing.far;
    // Rays nearer the horizon than that stand for directions that meet no ground.
    if (here > half) end = minimum(end, depth / sin(here - half));
    view.look(scattering, grazing, end);
    // The share of the ray's power in a radian; what lies beyond the last bin is lost.
    double angle = asin(minimum(depth / start, 1.0)) - asin(minimum(depth / end, 1.0));
    double last = minimum(lines.bin_at(end + shift), double(lines.count()));
    Span span(lines.bin_at(start + shift), last, lines.count());
    if (span.high < span.low || angle <= 0.0) return;
    double scale = place.weight * gamma * depth * size / angle;
    lines.widen(span.low, span.high);
    // Lambert's gamma falls with h / R; it is given for the range of the ray.
    auto lambert = [&](int64_t, double per_square) { return t * sqrt(per_square); };
    auto patched = [&](double range) { return patch_gamma(scattering, view, grazing, range); };
    // The first and the last bin are passed in part.
    const int64_t ends[] = {span.low, span.high};
    for (int64_t bin : ends) {
        double per_square = lines.per_square[bin], power = ground_at(per_square, depth, scale * span.share(bin));
        if (!constant_gamma) power *= lambert(bin, per_square);
        else if (is_patched) power *= patched(bin * size - shift);
        add_to_bin(lines, place, bin, power);
    }
    double second = (span.low + 1) * size - shift;
    auto patched_from = [&](int64_t bin, double) { return patched(second + (bin - span.low - 1) * size); };
    if (!constant_gamma) fill_ground(lines, place, span, depth, scale, lambert);
    else if (is_patched) fill_ground(lines, place, span, depth, scale, patched_from);
    else fill_ground(lines, place, span, depth, scale, [](int64_t, double) { return 1.0; });
}

// The integral of e^(-rate r) over a depth.
inline double mean_depth(double rate, double depth) {
    if (rate * depth < 1e-6) return depth; // where the difference below would lose its digits
    return (1.0 - exp(-rate * depth)) / rate;
}

// Add what a volume, of a cross section of each cubic metre, m^2/m^3, returns along the way of a ray through it. Loss
// is that up to there, and slope that of a metre within, dB one way.
inline void add_volume(const RangeLines& lines, const Place& place, double near, double far, double volume,
                       double loss, double slope) {
    double size = lines.bin_size, rate = 2.0 * slope / NEPER_DB; // nepers of power per metre, out and back
    Span span(lines.bin_at(near + place.shift), lines.bin_at(far + place.shift), lines.count());
    if (span.high < span.low) return;
    // Most bins are passed as a whole: their share is computed once.
    double fade = exp(-rate * size), whole = mean_depth(rate, size), begin = maximum(span.start, double(span.low));
    double left = place.weight * volume * pow(10.0, -0.2 * loss);
    left *= exp(-rate * (begin - span.start) * size);
    for (int64_t bin = span.low; bin <= span.high; bin++) {
        double depth = (minimum(span.end, bin + 1.0) - begin) * size, returned = left * whole;
        if (depth < 0.999999 * size) {
            returned = left * mean_depth(rate, depth);
            left *= exp(-rate * depth);
        } else {
            left *= fade;
        }
        add_to_bin(lines, place, bin, returned * lines.per_square[bin]);
        begin = bin + 1.0;
    }
    lines.widen(span.low, span.high);
}

} // namespace radarsim::fmcw
