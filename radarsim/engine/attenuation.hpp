// The penetration model: events along rays, the power that a ray loses, and where it ends.
//
// A ray starts with a penetration power. Inside volumes it loses, per metre, the sum of the densities of all volumes
// that enclose the point, and of the air. It ends at the first opaque surface, where its power runs out, or at its
// maximum range. An opaque surface absorbs power of its own; a ray that arrives with less returns nothing.
//
// A reflected ray consists of several straight segments. Each is followed separately and starts with the power left by
// the one before. This header knows neither the scene nor Embree: it follows one segment through its sorted list of
// crossings, in float64.
//
// A part encloses the ray where its winding number is positive: the winding number at the start, plus one for each
// triangle that the ray enters by its front, minus one for each that it leaves by its back. Hence overlapping shells
// of a part count once, cavities are outside, and two crossings on a grazed edge cancel in either order.
//
// Rule 1: the list of crossings is complete and without duplicates; intersect.hpp ensures that.
//
// Rule 2: the density is summed again after each crossing. Adding and subtracting would leave a rounding error: a ray
// that has left all volumes loses exactly nothing.
//
// Rule 3: a remaining power that is due to rounding alone counts as zero.
//
// Source: the recursion in a thesis on a radar for USARSim, written as a loop. There a penetrable object costs density
// times length, and the range that is measured is that of the point where the power runs out.
#pragma once
#include "intersect.hpp"

namespace radarsim {

// An EventKind.
enum class Kind : int32_t {
    START_INSIDE, ENTER, LEAVE, SHEET, HIT, SPENT, OUT_OF_RANGE, MIRRORED, ABSORBED, RAIN, NONE = -1
};

struct Event { // a row of EVENT
    int64_t ray;
    double t; // m from the ray's origin
    int32_t part;
    Kind kind;
    double power, absorbed, x, y, z;
};
ROW(Event, ray, t, part, kind, power, absorbed, x, y, z)

constexpr double ROUNDING = 1e-12; // share of the initial power that may be left by rounding

enum Outcome : uint8_t { NOTHING, HIT, SPENT, ABSORBED };

struct RayCosts {
    const double *density, *sheet_loss; // of each part
    double air;
    int64_t air_part;
};

// A straight piece of a ray's way.
struct Segment {
    Vector start, direction; // in the map
    double before;           // m that the ray has travelled before
};

// A ray at one point; one object serves many rays.
struct RayState {
    Buffer<Crossing> room;           // of the crossings
    Array<Crossing> crossings;     // of the segment
    Buffer<int32_t> winding;         // of each part
    List<int32_t> touched;         // parts whose winding number was changed
    Buffer<uint8_t> seen;            // whether a part is among them
    List<int32_t> enclosing;       // the parts around the point, last entered last
    Segment segment = {};
    Array<Event> events;           // empty if none are wanted
    int64_t event_count = 0;       // also of those for which there is no room

    RayState(int64_t parts, int64_t max_crossings, Array<Event> events)
        : room(max_crossings), crossings{room.data(), {max_crossings}}, winding(parts), touched(parts), seen(parts),
          enclosing(parts), events(events) {}
};

struct Progress {
    double t, power, min_power; // m from the start of the segment
    int64_t spent_in;           // the part that took the last of the power; -1 while there is some
};
struct SegmentEnd {
    int64_t crossed; // surfaces before
    double t;        // m from the start of the segment
    int64_t part;    // the opaque part there; -1 for the maximum range
};
struct RayEnd {
    double t; // m from the ray's origin
    Outcome outcome;
    int64_t part;
    double power;
};

// Add to a part's winding number. Returns 1 if the ray enters the part by that, -1 if it leaves it.
inline int update_winding(RayState& state, int32_t part, int32_t sign) {
    if (!state.seen[part]) {
        state.seen[part] = 1;
        state.touched.append(part);
    }
    bool was_inside = state.winding[part] > 0;
    state.winding[part] += sign;
    bool is_inside = state.winding[part] > 0;
    if (is_inside == was_inside) return 0;
    if (is_inside) {
        state.enclosing.append(part);
        return 1;
    }
    state.enclosing.remove(part); // the last in the list remains the last entered
    return -1;
}

inline void reset_winding(RayState& state) {
    // Only the parts that this ray has touched: a scene can have thousands.
    for (int32_t part : state.touched) state.winding[part] = state.seen[part] = 0;
    state.touched.clear();
    state.enclosing.clear();
}

inline void record_event(RayState& state, int64_t ray, double t, Kind kind, int64_t part, double power,
                         double absorbed) {
    if (!state.events.size()) return;
    if (state.event_count < state.events.size()) {
        const auto& [start, direction, before] = state.segment;
        auto [x, y, z] = (start + t * direction).numbers;
        state.events[state.event_count] = {ray, before + t, int32_t(part), kind, power, absorbed, x, y, z};
    }
    state.event_count++;
}

inline void start_ray(int64_t ray, Progress& progress, RayState& state) {
    for (int32_t part : state.enclosing) record_event(state, ray, 0.0, Kind::START_INSIDE, part, progress.power, 0.0);
    // A share of an infinite power is infinite: the ray would be depleted at once.
    progress.min_power = isfinite(progress.power) ? progress.power * ROUNDING : 0.0;
}

// The density is summed again after each crossing: a ray that has left all volumes loses exactly nothing.
inline double density_around(const RayState& state, const RayCosts& costs) {
    double total = costs.air;
    for (int32_t part : state.enclosing) total += costs.density[part];
    return total;
}

// Go from crossing to crossing as far as the power lasts.
inline void advance_ray(int64_t ray, const SegmentEnd& limit, const RayCosts& costs, RayState& state,
                        Progress& progress) {
    double at = progress.t, power = progress.power, min_power = progress.min_power;
    // Fields one by one, here and elsewhere: a structure that was just written to is slow to copy.
    auto note = [&](double left, int64_t spent_in) {
        progress.t = at, progress.power = left, progress.spent_in = spent_in;
    };
    double density = density_around(state, costs);
    // There is one stretch more than surfaces: the last one ends at the limit.
    for (int64_t i = 0; i <= limit.crossed; i++) {
        double t = i < limit.crossed ? state.crossings[i].t : limit.t;
        if (density > 0.0) {
            double left = power - density * (t - at);
            if (left <= min_power) {
                // Rounding must not carry the end past the next surface.
                at = minimum(at + power / density, t);
                int64_t innermost = state.enclosing.size() ? state.enclosing.end()[-1] : costs.air_part;
                return note(0.0, innermost);
            }
            power = left;
        }
        at = t;
        if (i == limit.crossed) break;
        const Crossing& crossing = state.crossings[i];
        double arriving = power, loss = costs.sheet_loss[crossing.part];
        Kind kind;
        if (!isnan(loss)) {
            kind = Kind::SHEET;
            power = maximum(power - loss, 0.0);
        } else {
            int change = update_winding(state, crossing.part, crossing.sign);
            kind = change > 0 ? Kind::ENTER : change < 0 ? Kind::LEAVE : Kind::NONE;
        }
        if (kind == Kind::NONE) continue;
        // An infinite power minus itself would be NaN.
        record_event(state, ray, at, kind, crossing.part, arriving, power < arriving ? arriving - power : 0.0);
        if (kind == Kind::SHEET && power <= min_power) return note(0.0, crossing.part);
        density = density_around(state, costs);
    }
    note(power, -1);
}

// Whether a surface absorbs all the power of a ray.
inline bool is_absorbed(double power, double min_power, double absorption) {
    // An infinite power minus an infinite absorption would be NaN.
    return isinf(absorption) || absorption - power > min_power;
}

inline RayEnd end_ray(int64_t ray, const Progress& progress, const SegmentEnd& end, double absorption,
                      RayState& state) {
    auto [at, power, min_power, spent_in] = progress;
    reset_winding(state);
    double t = state.segment.before + at;
    if (spent_in >= 0) {
        record_event(state, ray, at, Kind::SPENT, spent_in, 0.0, 0.0);
        return {t, SPENT, spent_in, 0.0};
    }
    if (end.part < 0) {
        record_event(state, ray, at, Kind::OUT_OF_RANGE, end.part, power, 0.0);
        return {t, NOTHING, end.part, power};
    }
    if (absorption > 0.0 && is_absorbed(power, min_power, absorption)) {
        record_event(state, ray, at, Kind::ABSORBED, end.part, power, absorption);
        return {t, ABSORBED, end.part, 0.0};
    }
    double absorbed = minimum(absorption, power); // rounding can make it greater
    record_event(state, ray, at, Kind::HIT, end.part, power, absorbed);
    return {t, HIT, end.part, power - absorbed};
}

} // namespace radarsim
