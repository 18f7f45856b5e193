// Trace all rays of a call: given ones, or those of scans, each aimed right before it is traced.
#pragma once
#include "aimed_rays.hpp"
#include "propagate.hpp"

namespace radarsim {

constexpr int64_t INCONSISTENT = INT64_MIN; // arrays that do not belong together
constexpr int CLEARANCE_CLASS = 1; // the class for which something may hide a ray

struct RaySource { // given rays, or one row of what the rays of a sensor have in common
    Array<const Vector> origins, directions;
    Array<const double> max_range, power;
    Array<const uint8_t> class_index;
    Array<const int64_t> carrier;
    const NodeTable* table; // of the sensor
    double radius;          // m, the largest distance from the sensor at which a ray starts
};
LAYOUT(RaySource, "o o r r r r", origins, directions, max_range, power, class_index, carrier, table, radius)

struct Scans {
    Array<const double[7]> places;  // a Place each
    Array<const double, 2> chances; // of each scan and beam; no columns if all nodes are aimed
    Array<int16_t> nodes;           // of each ray
    Array<int8_t> sides;            // of each ray
    Array<bool> clear;              // which scans were traced; others have something opaque near them

    const Place& place(int64_t scan) const { return *reinterpret_cast<const Place*>(places[scan]); }
    int64_t rays_per_scan() const { return nodes.size() / places.size(); }
    // Whether each ray has a node in the table.
    bool fit(const NodeTable& table) const {
        int64_t beams = table.beams(), all = table.nodes();
        if (!beams || !table.has_starts() || nodes.size() % (places.size() * beams)) return false;
        if (!chances.shape[1]) return rays_per_scan() <= all * beams;
        return chances.shape[1] == beams && chances.shape[0] == places.size() && table.edges.size() < all;
    }
};

// Whether there is certainly nothing opaque around a sensor.
inline bool is_clear(const RayTracer& tracer, const Vector& point, double radius, int64_t carrier) {
    double reach = radius + tracer.handle.margin;
    if (tracer.box_grid.is_near(carrier, point, reach)) return false;
    return !is_opaque_nearby(tracer.handle, &tracer.materials.forward_roles(CLEARANCE_CLASS, 0), point, reach);
}

inline int64_t trace_given(const RaySource& source, RayTracer& tracer, const Traces& traces) {
    for (int64_t i = 0; i < source.origins.size(); i++) {
        for (int axis = 0; axis < 3; axis++) {
            tracer.origin[axis] = source.origins[i][axis];
            tracer.direction[axis] = source.directions[i][axis];
        }
        if (int64_t code = tracer.trace(i, source.max_range[i], source.power[i], source.class_index[i],
                                        source.carrier[i], traces))
            return code;
    }
    return 0;
}

inline int64_t trace_scan(const RaySource& source, const Scans& scans, int64_t scan, RayTracer& tracer,
                          const Traces& traces) {
    const NodeTable& table = *source.table;
    Frame frame = frame_of(scans.place(scan));
    int64_t rays_per_scan = scans.rays_per_scan(), i = scan * rays_per_scan;
    for (int64_t beam = 0; beam < table.beams(); beam++)
        for (int64_t node = 0; node < rays_per_scan / table.beams(); node++, i++) {
            int64_t chosen = scans.chances.shape[1] ? node_of(table.edges, scans.chances(scan, beam)) : node;
            scans.nodes[i] = int16_t(chosen);
            scans.sides[i] = table.sides[chosen];
            aim_ray(table, frame, beam, chosen, tracer.origin, tracer.direction);
            if (int64_t code = tracer.trace(i, source.max_range[0], source.power[0], source.class_index[0],
                                            int64_t(scans.place(scan).carrier), traces))
                return code;
        }
    return 0;
}

// Trace rays, or scans if there are places. Returns 0; the number of surfaces on a segment that has more than there
// is room for; for an invalid ray, -1 minus its index; or INCONSISTENT. The summary is the number of events, the height of level
// rays that found no slice, their number, and the number of scans that are not clear.
inline int64_t trace_rays(const Scene& scene, const RaySource& source, Array<const RobotBox> boxes,
                          int64_t max_crossings, Array<Event> events, Array<double> ranges, Array<uint8_t> outcomes,
                          Array<int64_t> parts, Array<double> power, Array<double> incidence,
                          Array<const double[7]> places, Array<const double, 2> chances, Array<int16_t> nodes,
                          Array<int8_t> sides, Array<bool> clear, Array<double> summary) {
    bool is_given = !places.size();
    if (is_given && source.origins.size() != ranges.size()) return INCONSISTENT;
    if (is_given && source.origins.size() != source.power.size()) return INCONSISTENT;
    if (!is_given && nodes.size() != ranges.size()) return INCONSISTENT;
    if (incidence.size() && incidence.size() != ranges.size()) return INCONSISTENT;
    Room<Crossing> room(max_crossings);
    RayTracer tracer(scene, boxes, ranges.size(), {room.data(), {max_crossings}}, events);
    Traces traces = {ranges, outcomes, parts, power, incidence};
    Scans scans = {places, chances, nodes, sides, clear};
    if (!is_given && !scans.fit(*source.table)) return INCONSISTENT;
    if (!is_given && source.radius && tracer.materials.classes() <= CLEARANCE_CLASS) return INCONSISTENT;
    int64_t code = is_given ? trace_given(source, tracer, traces) : 0, crowded = 0;
    for (int64_t scan = 0; scan < places.size() && !code; scan++) {
        const Place& place = scans.place(scan);
        Vector point = {place.x - scene.centre[0], place.y - scene.centre[1], place.z - scene.centre[2]};
        clear[scan] = source.radius == 0.0 || is_clear(tracer, point, source.radius, int64_t(place.carrier));
        if (clear[scan])
            code = trace_scan(source, scans, scan, tracer, traces);
        else
            crowded++;
    }
    summary[0] = double(tracer.state.event_count), summary[1] = tracer.unsliced.height;
    summary[2] = tracer.unsliced.rays, summary[3] = double(crowded);
    return code;
}
DOOR(trace_rays, "b e r r r r i j hc s s j 4")

} // namespace radarsim
