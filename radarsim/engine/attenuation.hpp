// The penetration model: the events along a ray, the power that the ray loses, and the point at which it ends.
//
// A ray starts with a penetration power. Per metre it loses the sum of the densities of all volumes that enclose the
// point, and of the air. It ends at the first opaque surface, when its power is depleted, or at its maximum range. An
// opaque surface absorbs a certain power; a ray that arrives with less power has no echo.
//
// A reflected ray consists of several straight segments. Each segment is traced separately and starts with the power
// that is left from the previous segment. This header does not depend on the scene or on Embree: it follows a segment
// through its sorted list of crossings, in float64.
//
// A part encloses a point of the ray if its winding number there is positive. The winding number is its value at the
// start, plus one for each triangle that the ray enters through the front, minus one for each triangle that it leaves
// through the back. So overlapping shells of a part count once, cavities are outside of the part, and the two crossings
// of a ray that grazes an edge cancel each other in either order.
//
// Rule 1: the list of crossings is complete and without duplicates; intersect.hpp ensures this.
//
// Rule 2: the density is summed again after each crossing, since adding and subtracting would leave a rounding error. A
// ray that has left all volumes loses exactly nothing.
//
// Rule 3: a remaining power that is only a rounding error counts as zero.
//
// Source: the recursion in a thesis on a radar for USARSim, written as a loop. There a penetrable object costs density
// times length, and the measured range is the range of the point at which the power is depleted.
#pragma once
#include "intersect.hpp"

namespace radarsim {

// The kinds of events, the same as EventKind in Python.
enum class Kind : int32_t {
    START_INSIDE, ENTER, LEAVE, SHEET, HIT, SPENT, OUT_OF_RANGE, MIRRORED, ABSORBED, RAIN, NONE = -1
};

struct Event { // a row of EVENT
    int64_t ray;
    double t; // distance from the origin of the ray, m
    int32_t part;
    Kind kind;
    double power, absorbed, x, y, z;
};
ROW(Event, ray, t, part, kind, power, absorbed, x, y, z)

constexpr double ROUNDING = 1e-12; // share of the initial power that counts as a rounding error

enum Outcome : uint8_t { NOTHING, HIT, SPENT, ABSORBED };

struct RayCosts {
    const double *density, *sheet_loss; // per part
    double air;
    int64_t air_part;
};

// A straight segment of a ray's path.
struct Segment {
    Vector start, direction; // map frame
    double before;           // m, length of the previous segments
};

// The state of a ray at a point; one object is reused for many rays.
struct RayState {
    Buffer<Crossing> room;           // memory for the crossings
    Array<Crossing> crossings;     // crossings of the segment
    Buffer<int32_t> winding;         // winding number of each part
    List<int32_t> touched;         // parts whose winding number was changed
    Buffer<uint8_t> seen;            // whether a part is in the list touched
    List<int32_t> enclosing;       // the parts that enclose the point, the last entered part last
    Segment segment = {};
    Array<Event> events;           // empty if events are not recorded
    int64_t event_count = 0;       // number of events, including events that did not fit into the array

    RayState(int64_t parts, int64_t max_crossings, Array<Event> events)
        : room(max_crossings), crossings{room.data(), {max_crossings}}, winding(parts), touched(parts), seen(parts),
          enclosing(parts), events(events) {}
};

struct Progress {
    double t, power, min_power; // m from the start of the segment
    int64_t spent_in;           // the part in which the power was depleted; -1 if power is left
};
struct SegmentEnd {
    int64_t crossed; // number of surfaces crossed before the end
    double t;        // m from the start of the segment
    int64_t part;    // the opaque part at the end; -1 for the maximum range
};
struct RayEnd {
    double t; // distance from the origin of the ray, m
    Outcome outcome;
    int64_t part;
    double power;
};

// Add to a part's winding number. Returns 1 if the ray enters the part by this change, -1 if it leaves the part,
// otherwise 0.
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
    state.enclosing.remove(part); // keeps the order, so the last part in the list is still the last entered
    return -1;
}

inline void reset_winding(RayState& state) {
    // Only parts that this ray has touched are reset, since a scene can have thousands of parts.
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
    // A share of an infinite power is infinite, so the ray would be depleted immediately.
    progress.min_power = isfinite(progress.power) ? progress.power * ROUNDING : 0.0;
}

// Sum the densities of the air and of all volumes around the point (rule 2).
inline double density_around(const RayState& state, const RayCosts& costs) {
    double total = costs.air;
    for (int32_t part : state.enclosing) total += costs.density[part];
    return total;
}

// Advance the ray from crossing to crossing until the limit, or until its power is depleted.
inline void advance_ray(int64_t ray, const SegmentEnd& limit, const RayCosts& costs, RayState& state,
                        Progress& progress) {
    double at = progress.t, power = progress.power, min_power = progress.min_power;
    // Fields are written one by one, since copying a structure that was just written is slow.
    auto note = [&](double left, int64_t spent_in) {
        progress.t = at, progress.power = left, progress.spent_in = spent_in;
    };
    double density = density_around(state, costs);
    // There is one more interval than there are surfaces: the last interval ends at the limit.
    for (int64_t i = 0; i <= limit.crossed; i++) {
        double t = i < limit.crossed ? state.crossings[i].t : limit.t;
        if (density > 0.0) {
            double left = power - density * (t - at);
            if (left <= min_power) {
                // Rounding errors must not move the end beyond the next surface.
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
        // The powers are subtracted only if they differ, since an infinite power minus itself would be NaN.
        record_event(state, ray, at, kind, crossing.part, arriving, power < arriving ? arriving - power : 0.0);
        if (kind == Kind::SHEET && power <= min_power) return note(0.0, crossing.part);
        density = density_around(state, costs);
    }
    note(power, -1);
}

// Whether a surface absorbs all the power of a ray.
inline bool is_absorbed(double power, double min_power, double absorption) {
    // An infinite absorption is a special case, since subtracting an infinite power from it would give NaN.
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
    double absorbed = minimum(absorption, power); // the absorption may be greater by a rounding error
    record_event(state, ray, at, Kind::HIT, end.part, power, absorbed);
    return {t, HIT, end.part, power - absorbed};
}

} // namespace radarsim
