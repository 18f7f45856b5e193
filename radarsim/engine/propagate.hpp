// Traces a ray segment by segment to its end.
#pragma once
#include "attenuation.hpp"
#include "robot_boxes.hpp"

namespace radarsim {

constexpr int64_t UNKNOWN = -2; // used instead of a part if the search window ended and the ray continues
// Surfaces are searched window by window. The first window is FIRST_WINDOW times the path on which the densest volume
// absorbs all power; each following window is WINDOW_GROWTH times as long as the previous one.
constexpr double FIRST_WINDOW = 1.4, WINDOW_GROWTH = 4.0;
constexpr double RANGE_TOLERANCE = 1e-9; // m; a surface up to this far beyond the range is within the range
constexpr double NEAR_REACH = 0.5;       // m; half side of the box in which near_volumes_ is valid
constexpr double NEAR_SLACK = 1e-6;      // m; more than the rounding errors of coordinates
constexpr double MIRROR_OFFSET = 1e-9;   // m; distance of the next segment's start from a mirror
constexpr double UNIT_TOLERANCE = 2e-9;  // tolerance of the squared length of a direction

// The properties of the parts of a scene for each class of rays, by class and part; see traced_scene.py.
struct MaterialTable {
    Array<const double, 2> density, sheet_loss; // power lost per metre, and per crossed sheet; nan for volumes
    Array<const double, 2> absorption;          // power that an opaque surface absorbs
    Array<const uint8_t, 2> mirror;             // whether an opaque surface is a mirror
    Array<const double, 2> passing;             // power lost at a surface of a pane; inf for other surfaces
    Array<const double> air;                    // power lost per metre of air, per class
    Array<const int64_t> max_reflections;       // maximum number of reflections of a ray
    Array<const double> glint;                  // a mirror ends a ray if the cosine to its normal is at least this
    Array<const double> max_density;            // the greatest density of volumes, or its equivalent for sheets
    Array<const uint8_t, 2> forward_roles, backward_roles; // Role of a part ahead of the ray, and behind its start
    Array<const int32_t> volume;                // the parts that are penetrable volumes
    Array<const Vector> low, high;              // m, bounds of these volumes; the last row bounds all of them

    int64_t classes() const { return density.shape[0]; }
    int64_t parts() const { return density.shape[1]; }
};
LAYOUT(MaterialTable, "cp cp cp cp cp c c c c cp cp v w w", density, sheet_loss, absorption, mirror, passing, air,
       max_reflections, glint, max_density, forward_roles, backward_roles, volume, low, high)

struct Scene {
    const SceneHandle* handle;
    const MaterialTable* materials;
    Array<const Vector> centre; // m, the origin of all other coordinates
    Array<const Triangle> triangles;
};
LAYOUT(Scene, "1 t", handle, materials, centre, triangles)

struct Traces { // one row for each ray
    Array<double> ranges;
    Array<uint8_t> outcomes;
    Array<int64_t> parts;
    Array<double> power, incidence; // incidence is empty if it is not requested
};

// Traces rays through a scene, one after the other.
class RayTracer {
  public:
    RayTracer(const Scene& scene, const BoxGrid& box_grid, int64_t max_crossings, Array<Event> events)
        : scene(scene), handle(*scene.handle), materials(*scene.materials), box_grid(box_grid),
          state(materials.parts(), max_crossings, events), near_volumes_(materials.volume.size()) {
        prepare_query(handle, query_, state.crossings);
    }

    const Scene& scene;
    const SceneHandle& handle;
    const MaterialTable& materials;
    const BoxGrid& box_grid;
    RayState state;
    Unsliced unsliced = {};
    Vector origin, direction; // of the ray: to be set in the map frame before each call of trace

    // Trace a ray. Returns 0; or the number of crossings of a segment with too many crossings; or -1 minus the index of
    // the ray if it is invalid.
    int64_t trace(int64_t row, double max_range, double power, uint8_t ray_class, int64_t carrier,
                  const Traces& traces) {
        if (!is_valid(max_range, power) || ray_class >= materials.classes()) return -1 - row;
        origin = origin - scene.centre[0];
        row_ = row, class_ = ray_class, carrier_ = carrier;
        reflections_ = materials.max_reflections[ray_class];
        start_segment(0.0);
        Progress progress = {0.0, power, 0.0, -1};
        SegmentEnd end;
        WayOn on;
        while (true) {
            double before = state.segment.before;
            if (int64_t needed = trace_segment(progress, max_range - before, end)) {
                reset_winding(state);
                return needed;
            }
            on = find_way_on(progress, end);
            if (on.way == Way::ENDS) break;
            record_event(state, row, progress.t, on.way == Way::PASSED ? Kind::SHEET : Kind::MIRRORED, end.part,
                         progress.power, on.cost);
            reset_winding(state);
            go_on(on.way, progress.t);
            if (on.way == Way::REFLECTED) carrier_ = -1; // after a reflection the ray can hit its own robot
            start_segment(before + progress.t);
            progress = {0.0, progress.power - on.cost, progress.min_power, -1};
            reflections_ -= on.is_bounce;
        }
        RayEnd ray_end = end_ray(row, progress, end, on.cost, state);
        traces.ranges[row] = ray_end.outcome == HIT || ray_end.outcome == SPENT ? ray_end.t : INFINITE;
        traces.outcomes[row] = ray_end.outcome;
        traces.parts[row] = ray_end.part;
        traces.power[row] = ray_end.power;
        if (traces.incidence.size()) traces.incidence[row] = incidence_of(ray_end);
        return 0;
    }

  private:
    enum class Way { ENDS, REFLECTED, PASSED };
    struct WayOn {
        Way way;
        double cost;    // power that the surface absorbs
        bool is_bounce; // whether it counts towards max_reflections
    };

    bool is_valid(double max_range, double power) const {
        if (!(isfinite(origin[0]) && isfinite(origin[1]) && isfinite(origin[2]))) return false;
        if (!(fabs(dot(direction, direction) - 1.0) <= UNIT_TOLERANCE)) return false;
        return 0.0 <= max_range && max_range < INFINITE && power >= 0.0;
    }

    // The row of a table for the class of the ray.
    template <typename T> T* of_class(Array<T, 2> table) const { return table.row(class_); }

    void start_segment(double before) {
        state.segment.before = before;
        if (state.events.size()) state.segment.start = origin + scene.centre[0], state.segment.direction = direction;
    }

    // Return the unit normal of the triangle at which the last segment ended.
    Vector opaque_normal() const {
        const Triangle& corners = scene.triangles[opaque_triangle(handle, query_)];
        Vector a = corner_of(corners, 1) - corner_of(corners, 0), b = corner_of(corners, 2) - corner_of(corners, 0);
        Vector normal = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
        return normal / length_of(normal);
    }

    // Find how the ray continues at the end of a segment: it ends, is reflected, or passes a pane.
    WayOn find_way_on(const Progress& progress, const SegmentEnd& end) const {
        // Robots have indices above the indices of parts, and are not mirrors.
        if (progress.spent_in >= 0 || end.part < 0 || end.part >= materials.parts())
            return {Way::ENDS, 0.0, false};
        WayOn on = way_on_from(end.part);
        if (is_absorbed(progress.power, progress.min_power, on.cost)) return {Way::ENDS, on.cost, false};
        return on;
    }

    WayOn way_on_from(int64_t part) const {
        double absorbed = of_class(materials.absorption)[part];
        if (!of_class(materials.mirror)[part]) return {Way::ENDS, absorbed, false};
        double passing = of_class(materials.passing)[part];
        double ahead = dot(opaque_normal(), direction);
        if (ahead > 0.0 && passing < INFINITE) return {Way::PASSED, passing, false}; // leaves a pane
        if (reflections_ <= 0 || fabs(ahead) >= materials.glint[class_]) return {Way::ENDS, absorbed, false};
        // The ray passes the pane or is reflected, whichever loses less. Power counts one way only, so both values are
        // half of the loss in dB.
        if (passing <= absorbed) return {Way::PASSED, passing, true};
        return {Way::REFLECTED, 2.0 * absorbed, true}; // the echo meets the mirror again on its way back
    }

    // Drop the crossings that coincide with a mirror at the end of a segment, since the next segment starts slightly
    // before the mirror and would cross them again.
    void end_before_mirror(SegmentEnd& end) const {
        if (reflections_ <= 0 || end.part < 0 || end.part >= materials.parts()) return;
        if (!of_class(materials.mirror)[end.part]) return;
        // Along an oblique ray the offset from the mirror's plane is longer.
        double near = end.t - MIRROR_OFFSET / maximum(fabs(dot(opaque_normal(), direction)), MIRROR_OFFSET);
        while (end.crossed > 0 && state.crossings[end.crossed - 1].t >= near) end.crossed--;
    }

    // Set origin and direction of the next segment after a segment of length t, m.
    void go_on(Way way, double t) {
        if (way == Way::PASSED) {
            origin = origin + (t + MIRROR_OFFSET) * direction;
            return;
        }
        Vector normal = opaque_normal();
        double ahead = dot(normal, direction);
        if (ahead > 0.0) normal = -1.0 * normal, ahead = -ahead; // the ray hit the back of the triangle
        // The start is moved off the mirror along the normal. Along a grazing ray it would stay within rounding errors
        // of the surface, and the ray would hit it again.
        origin = origin + (t * direction + MIRROR_OFFSET * normal);
        direction = direction - 2.0 * ahead * normal;
    }

    double incidence_of(const RayEnd& end) const {
        if (end.outcome != HIT) return NOT_A_NUMBER;
        if (end.part >= materials.parts()) // a robot
            return box_incidence(box_grid.boxes, end.part - materials.parts(), origin, direction,
                                 end.t - state.segment.before);
        return minimum(fabs(dot(opaque_normal(), direction)), 1.0);
    }

    bool is_in_bounds(int64_t volume, double margin) const {
        const Vector &low = materials.low[volume], &high = materials.high[volume];
        for (int axis = 0; axis < 3; axis++)
            if (origin[axis] < low[axis] - margin || origin[axis] > high[axis] + margin) return false;
        return true;
    }

    // Whether the ray starts inside the bounding box of a volume that it can penetrate.
    bool is_near_volume() {
        double margin = handle.margin;
        // The last row bounds all volumes, so a single test is enough for most rays.
        if (!is_in_bounds(materials.volume.size(), margin)) return false;
        // A forest has thousands of volumes, but only few near a sensor, which are cached.
        double distance = 0.0;
        for (int axis = 0; axis < 3; axis++) distance = maximum(distance, fabs(origin[axis] - near_place_[axis]));
        if (distance > NEAR_REACH) {
            near_volumes_.clear();
            for (int64_t k = 0; k < materials.volume.size(); k++)
                if (is_in_bounds(k, margin + NEAR_REACH + NEAR_SLACK)) near_volumes_.append(k);
            near_place_ = origin;
        }
        for (int64_t k : near_volumes_)
            if (of_class(materials.backward_roles)[materials.volume[k]] && is_in_bounds(k, margin)) return true;
        return false;
    }

    // Set the winding numbers at the origin from the crossings behind it; returns their number. If the array is too
    // short for the crossings, no winding number is set.
    int64_t find_enclosing() {
        run_query(handle, query_, materials.parts(), of_class(materials.backward_roles), origin, direction, -1.0,
                  -INFINITE, BEHIND, INFINITE);
        if (query_.count > state.crossings.size()) return query_.count;
        // Crossings are processed from the farthest to the nearest, so the last entered part is last in the list.
        sort_crossings(state.crossings.data, query_.count);
        for (int64_t i = 0; i < query_.count; i++)
            update_winding(state, state.crossings[i].part, state.crossings[i].sign);
        return query_.count;
    }

    // Find the opaque surface that stops the ray in an interval, and the crossings before it. The count exceeds the
    // length of the array if crossings did not fit; the part is UNKNOWN if the ray may continue.
    void next_opaque(double near, double far, double window, const SegmentEnd& limit, SegmentEnd& end) {
        run_query(handle, query_, materials.parts(), of_class(materials.forward_roles), origin, direction, 1.0, near,
                  far, window);
        int64_t count = query_.count;
        double t = query_.far;
        // The window may end before the opaque surface, if a nearer surface was found later.
        int64_t part = query_.stop_t <= t ? int64_t(query_.stop_part) : -1;
        if (count > state.crossings.size()) {
            end.crossed = count;
            return;
        }
        // The search ended at the end of either the window or the interval.
        if (part < 0) part = t < far ? UNKNOWN : limit.part;
        // An opaque surface may be found up to RANGE_TOLERANCE beyond the limit.
        double last = minimum(t, limit.t);
        sort_crossings(state.crossings.data, count);
        while (count > 0 && state.crossings[count - 1].t > last) count--;
        end.crossed = count, end.t = last, end.part = part;
    }

    // Follow a segment window by window to its end; returns 0, or the number of crossings if there were too many.
    int64_t march(Progress& progress, const SegmentEnd& limit, SegmentEnd& end) {
        RayCosts costs = {of_class(materials.density), of_class(materials.sheet_loss), materials.air[class_],
                          materials.parts() - 1};
        // The window is infinite if nothing absorbs power. A surface exactly at the maximum range counts, even if a
        // rounding error has moved it beyond the range.
        double window = FIRST_WINDOW * progress.power / materials.max_density[class_], near = 0.0;
        while (true) {
            next_opaque(near, limit.t + RANGE_TOLERANCE, window, limit, end);
            if (end.crossed > state.crossings.size()) return end.crossed;
            end_before_mirror(end);
            advance_ray(row_, end, costs, state, progress);
            if (progress.spent_in >= 0 || end.part != UNKNOWN) return 0;
            // The next window begins at the next representable number.
            near = nextafter(end.t, INFINITE), window *= WINDOW_GROWTH;
        }
    }

    // Trace a straight segment of the ray to its end; returns the same codes as march.
    int64_t trace_segment(Progress& progress, double max_range, SegmentEnd& end) {
        // The slice is selected for each segment, since a mirror may change whether the ray is level.
        select_scene(handle, query_, origin, direction, unsliced);
        if (is_near_volume()) {
            int64_t needed = find_enclosing();
            if (needed > state.crossings.size()) return needed;
        }
        int64_t box;
        double t = box_grid.intersect(carrier_, origin, direction, max_range, box);
        // Boxes of robots have indices above the indices of parts.
        SegmentEnd limit = {0, t, box >= 0 ? materials.parts() + box : -1};
        // After a reflection the ray keeps its min_power, and START_INSIDE events are not recorded again.
        if (state.segment.before == 0.0) start_ray(row_, progress, state);
        return march(progress, limit, end);
    }

    Query query_;
    Vector near_place_ = {INFINITE, INFINITE, INFINITE};
    List<int64_t> near_volumes_; // volumes around near_place_, for all rays that start near it
    int64_t row_, class_, carrier_, reflections_;
};

} // namespace radarsim
