// Trace all rays of a call on several threads: either given rays, or the rays of scans, which are aimed just before
// they are traced.
#pragma once
#include "directions.hpp"
#include "propagate.hpp"
#include <pthread.h>
#include <signal.h>

namespace radarsim {

// Calls work(part) for each part from 0, on several threads; each free thread takes the next part. The results do not
// depend on the number of threads, provided that a part does not depend on its thread.
template <typename Work> class ParallelWork {
  public:
    ParallelWork(int64_t threads, int64_t parts, Work& work) : parts_(parts), work_(work) {
        Buffer<pthread_t> others(threads);
        int64_t started = 0;
        sigset_t all, before;
        sigfillset(&all);
        pthread_sigmask(SIG_BLOCK, &all, &before); // signals must be handled by the program's own threads
        for (; started < minimum(threads, parts) - 1; started++)
            if (pthread_create(&others[started], nullptr, run, this)) break; // the existing threads do all parts
        pthread_sigmask(SIG_SETMASK, &before, nullptr);
        run(this);
        for (int64_t i = 0; i < started; i++) pthread_join(others[i], nullptr);
        if (failed_) Attempt::fail();
    }

  private:
    static void* run(void* self) {
        auto& [parts, next, failed, work] = *static_cast<ParallelWork*>(self);
        Attempt attempt([&] {
            for (int64_t part; (part = __atomic_fetch_add(&next, 1, __ATOMIC_RELAXED)) < parts;) work(part);
        });
        if (!attempt.succeeds) __atomic_store_n(&failed, true, __ATOMIC_RELAXED);
        return nullptr;
    }

    int64_t parts_, next_ = 0;
    bool failed_ = false;
    Work& work_;
};

constexpr int64_t INCONSISTENT = bindings::REFUSED; // error code for arrays that do not match each other
constexpr int64_t PARTS_PER_THREAD = 4;
constexpr int64_t MOST_CROSSINGS = 1 << 26, MOST_THREADS = 1024; // limits of memory
constexpr int CLEARANCE_CLASS = 1; // the ray class for the segment from a sensor to the start of its ray
constexpr int MIDDLE_NODE = 1;     // the node of three that starts at the sensor itself

struct RaySource { // given rays, one per row, or a single row with the properties that all rays of a sensor share
    Array<const Vector> origins, directions;
    Array<const double> max_range, power;
    Array<const uint8_t> class_index;
    Array<const int64_t> carrier;
    const NodeTable* table; // nodes of the sensor
    double radius;          // m, the largest distance from the sensor at which a ray starts
};
LAYOUT(RaySource, "o o r r r r", origins, directions, max_range, power, class_index, carrier, table, radius)

struct Scans {
    Array<const double[7]> places;  // a Place per scan
    Array<const double, 2> chances; // random numbers by scan and beam; no columns if rays of all nodes are traced
    Array<int16_t> nodes;           // node of each ray
    Array<int8_t> sides;            // side of each ray

    int64_t rays_per_scan() const { return nodes.size() / places.size(); }
    // Whether the node of each ray is in the table.
    bool fit(const NodeTable& table) const {
        int64_t beams = table.beams(), all = table.nodes();
        if (!beams || !table.is_valid() || nodes.size() % (places.size() * beams)) return false;
        if (!chances.shape[1]) return rays_per_scan() <= all * beams;
        return chances.shape[1] == beams && chances.shape[0] == places.size() && table.edges.size() < all;
    }
};

inline bool belong_together(const Scene& scene, const RaySource& source, const Scans& scans, const Traces& traces) {
    int64_t rays = traces.ranges.size(), angles = traces.incidence.size();
    const MaterialTable& materials = *scene.materials;
    if (materials.low.size() != materials.volume.size() + 1) return false;
    if (scene.triangles.size() != (*scene.handle)[0].triangles.size()) return false;
    if (angles && angles != rays) return false;
    if (!scans.places.size()) return source.origins.size() == rays && source.power.size() == rays;
    if (source.radius && (materials.classes() <= CLEARANCE_CLASS || source.table->nodes() <= MIDDLE_NODE)) return false;
    return source.power.size() == 1 && scans.nodes.size() == rays && scans.fit(*source.table);
}

// Whether there is certainly no opaque surface between a sensor and the starts of its rays.
inline bool is_clear(const RaySource& source, const Place& place, const RayTracer& tracer) {
    if (source.radius == 0.0) return true;
    const Scene& scene = tracer.scene;
    double reach = source.radius + scene.handle->margin;
    Vector point = Vector{place.x, place.y, place.z} - scene.centre[0];
    return !tracer.box_grid.is_near(whole_of(place.carrier), point, reach) &&
           !is_opaque_nearby(*scene.handle, scene.materials->forward_roles.row(CLEARANCE_CLASS), point, reach);
}

// The result of tracing a part of the rays in a call.
struct TracePart {
    int64_t code; // result code, as in trace_rays
    Array<Event> events;
    int64_t event_count; // number of events, including events that did not fit into the array
    Unsliced unsliced;
};

inline int64_t trace_given(const RaySource& source, int64_t first, int64_t last, RayTracer& tracer,
                           const Traces& traces) {
    for (int64_t i = first; i < last; i++) {
        tracer.origin = source.origins[i], tracer.direction = source.directions[i];
        if (int64_t code = tracer.trace(i, source.max_range[i], source.power[i], source.class_index[i],
                                        source.carrier[i], traces))
            return code;
    }
    return 0;
}

// Find whether an opaque surface is between a sensor and the start of its aimed ray. Returns the same codes as
// trace_rays; the function changes origin and direction of the tracer.
inline int64_t find_hidden(int64_t row, const Frame& frame, int64_t carrier, RayTracer& tracer, const Traces& traces,
                           bool& is_hidden) {
    Vector way = tracer.origin - frame.position;
    double length = length_of(way);
    is_hidden = false;
    if (!(length > 0.0)) return 0;
    tracer.origin = frame.position, tracer.direction = way / length;
    int64_t event_count = tracer.state.event_count; // events before the start are not part of the scan
    int64_t code = tracer.trace(row, length, INFINITE, CLEARANCE_CLASS, carrier, traces);
    tracer.state.event_count = event_count;
    is_hidden = traces.outcomes[row] != NOTHING;
    return code;
}

// Trace the rays of a range of beams; beams are numbered scan by scan. The middle ray replaces rays whose start is
// hidden from the sensor.
inline int64_t trace_beams(const RaySource& source, const Scans& scans, int64_t first, int64_t last, RayTracer& tracer,
                           const Traces& traces) {
    const NodeTable& table = *source.table;
    int64_t beams = table.beams(), nodes = scans.rays_per_scan() / beams;
    int64_t scan = first / beams, beam = first % beams, row = first;
    bool is_hidden = false;
    for (; row < last; scan++, beam = 0) {
        const Place& place = place_of(scans.places, scan);
        Frame frame = frame_of(place);
        int64_t carrier = whole_of(place.carrier);
        bool clear = is_clear(source, place, tracer);
        for (; row < last && beam < beams; row++, beam++)
            for (int64_t node = 0, i = row * nodes; node < nodes; node++, i++) {
                int64_t chosen = scans.chances.shape[1] ? node_of(table.edges, scans.chances(scan, beam)) : node;
                aim_ray(table, frame, beam, chosen, tracer.origin, tracer.direction);
                if (!clear) {
                    if (int64_t code = find_hidden(i, frame, carrier, tracer, traces, is_hidden)) return code;
                    if (is_hidden) chosen = MIDDLE_NODE;
                    aim_ray(table, frame, beam, chosen, tracer.origin, tracer.direction);
                }
                scans.nodes[i] = int16_t(chosen);
                scans.sides[i] = table.sides[chosen];
                if (int64_t code = tracer.trace(i, source.max_range[0], source.power[0], source.class_index[0],
                                                carrier, traces))
                    return code;
            }
    }
    return 0;
}

// Move the events of all parts to a contiguous range; returns the first code. If the array of a part was too short, the
// number of events in the summary is the total length with which no array would be too short.
inline int64_t join_parts(Array<TracePart> parts, Array<Event> events, Array<double> summary) {
    int64_t code = 0, count = 0, needed = 0;
    Unsliced unsliced = {};
    for (TracePart& part : parts) {
        if (!code) code = part.code;
        if (part.event_count > part.events.size() && needed < part.event_count * parts.size())
            needed = part.event_count * parts.size();
        if (!needed) memmove(events.data + count, part.events.data, part.event_count * sizeof(Event));
        count += part.event_count;
        if (part.unsliced.rays) unsliced = {part.unsliced.height, unsliced.rays + part.unsliced.rays};
    }
    summary[0] = double(needed ? needed : count), summary[1] = unsliced.height, summary[2] = unsliced.rays;
    return code;
}

// Trace rays, or scans if there are places. Returns 0; or the number of crossings of a segment that has more than
// max_crossings; or, for an invalid ray, -1 minus its index; or INCONSISTENT. The summary has the number of events, the
// height of level rays without slice, and their number.
inline int64_t trace_rays(const Scene& scene, const RaySource& source, Array<const RobotBox> boxes,
                          int64_t max_crossings, Array<Event> events, Array<double> ranges, Array<uint8_t> outcomes,
                          Array<int64_t> parts, Array<double> power, Array<double> incidence,
                          Array<const double[7]> places, Array<const double, 2> chances, Array<int16_t> nodes,
                          Array<int8_t> sides, int64_t threads, Array<double> summary) {
    Traces traces = {ranges, outcomes, parts, power, incidence};
    Scans scans = {places, chances, nodes, sides};
    if (!belong_together(scene, source, scans, traces)) return INCONSISTENT;
    if (max_crossings < 0 || max_crossings > MOST_CROSSINGS) return INCONSISTENT;
    if (threads < 1 || threads > MOST_THREADS) return INCONSISTENT;
    BoxGrid grid(boxes, ranges.size());
    // There are more parts than threads, since some rays take longer than others.
    int64_t count = threads > 1 ? PARTS_PER_THREAD * threads : 1;
    if (events.size() && events.size() < count) count = 1; // each part needs room for events
    int64_t rows = places.size() ? places.size() * source.table->beams() : ranges.size();
    int64_t share = events.size() / count; // number of events for which each part has room
    Buffer<TracePart> found(count);
    auto trace_part = [&](int64_t i) {
        int64_t first = rows * i / count, last = rows * (i + 1) / count;
        TracePart& part = found[i];
        part.events = {events.data + i * share, {share}};
        RayTracer tracer(scene, grid, max_crossings, part.events);
        part.code = places.size() ? trace_beams(source, scans, first, last, tracer, traces)
                                  : trace_given(source, first, last, tracer, traces);
        part.event_count = tracer.state.event_count, part.unsliced = tracer.unsliced;
    };
    ParallelWork(threads, count, trace_part);
    return join_parts({found.data(), {count}}, events, summary);
}
BIND(trace_rays, "b e r r r r i j hc s s 3")

} // namespace radarsim
