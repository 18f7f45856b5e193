// Where a line crosses triangles, in float64, and queries to Embree: what a ray intersects, what is near a point (see
// embree.py).
//
// The triangle is seen along the line: points are sheared so that the line becomes the third axis. The line crosses
// the triangle if the origin is inside the triangle's projection onto the first two axes, which is so where it is on
// the same side of all three edges. The depth of the crossing is interpolated from the depths of the corners.
//
// Rule 1: each corner is sheared on its own by the same operations, so that it has one projection, whichever triangle
// it is taken from.
//
// Rule 2: the side of an edge is the sign of a difference of two products. Rounding can make this difference zero, but
// never reverses its sign; computed for the triangle on the other side of the edge, it is the exact opposite.
//
// Rule 3: where it is zero, the line goes through the edge. It is treated as passing beside the edge, displaced by an
// infinitesimal step along the first axis and a still smaller one along the second, the same for all triangles
// (simulation of simplicity). Hence a line through an edge or a corner crosses exactly one triangle of a surface, and
// along any line a closed surface is entered as often as it is left.
//
// Rule 4: the depth is a mean of the corners' depths with weights of one sign, so that no grazing line is given a
// crossing outside the triangle.
#pragma once
#include "bindings.hpp"

namespace radarsim {

constexpr double INFINITESIMAL = 1e-290; // by which a line is displaced from an edge
constexpr double TINY = 1e-30;           // coordinates below are set to zero

// One surface that a ray crosses.
struct Crossing {
    double t;     // m
    int32_t part;
    int32_t sign; // added to the part's winding number: 1 on entering, -1 on leaving
};

// The shear that makes a line the third axis.
struct Line {
    int first, second, third; // the axes of space in the order of projection
    double origin[3];         // m, in that order
    double shear_first, shear_second;
    double scale;             // of depths
};

inline double flush_to_zero(double number) { return fabs(number) < TINY ? 0.0 : number; }

inline Line project_line(const Vector& origin, const Vector& direction) {
    int third = 0; // the line's steepest axis: no factor below is greater than 1
    if (fabs(direction[1]) > fabs(direction[third])) third = 1;
    if (fabs(direction[2]) > fabs(direction[third])) third = 2;
    Line line;
    line.first = (third + 1) % 3, line.second = (third + 2) % 3, line.third = third;
    line.origin[0] = flush_to_zero(origin[line.first]);
    line.origin[1] = flush_to_zero(origin[line.second]);
    line.origin[2] = flush_to_zero(origin[third]);
    line.scale = 1.0 / direction[third];
    line.shear_first = flush_to_zero(direction[line.first] * line.scale);
    line.shear_second = flush_to_zero(direction[line.second] * line.scale);
    return line;
}

// Twice the signed area of the origin and an edge from a to b: its sign is the side of the edge on
// which the line passes; it is 0 only for an edge that is seen as a point.
inline double edge_side(double ax, double ay, double bx, double by) {
    double area = ax * by - ay * bx;
    if (area != 0.0) return area;
    double end = ay != by ? ay : bx, start = ay != by ? by : ax;
    if (end == start) return 0.0;
    return end > start ? INFINITESIMAL : -INFINITESIMAL;
}

// Intersect a line with one triangle. Returns 1 if the line enters by the front face, -1 if it
// leaves by the back face, 0 if it misses; t is the distance along the line.
inline int cross_triangle(const Line& line, const Triangle& corners, double& t) {
    const double* p = corners;
    int i = line.first, j = line.second, k = line.third;
    double az = p[k] - line.origin[2], bz = p[k + 3] - line.origin[2], cz = p[k + 6] - line.origin[2];
    double ax = p[i] - line.origin[0] - line.shear_first * az;
    double bx = p[i + 3] - line.origin[0] - line.shear_first * bz;
    double cx = p[i + 6] - line.origin[0] - line.shear_first * cz;
    double ay = p[j] - line.origin[1] - line.shear_second * az;
    double by = p[j + 3] - line.origin[1] - line.shear_second * bz;
    double cy = p[j + 6] - line.origin[1] - line.shear_second * cz;
    double a = edge_side(bx, by, cx, cy), b = edge_side(cx, cy, ax, ay), c = edge_side(ax, ay, bx, by);
    double area = a + b + c; // of one sign if the line passes all edges on the same side
    if (area == 0.0 || (minimum(a, b, c) < 0.0 && maximum(a, b, c) > 0.0)) return 0;
    t = line.scale * ((a * az + b * bz + c * cz) / area);
    return (area > 0.0) == (line.scale > 0.0) ? -1 : 1;
}

// Order by distance; at equal distances by part, and entering before leaving.
inline bool comes_after(const Crossing& one, const Crossing& other) {
    if (one.t != other.t) return one.t > other.t;
    if (one.part != other.part) return one.part > other.part;
    return one.sign < other.sign;
}

// Shell's sort with gaps of 3k + 1: most rays have a few crossings.
inline void sort_crossings(Crossing* crossings, int64_t count) {
    int64_t gap = 1;
    while (gap < count / 3) gap = 3 * gap + 1;
    for (; gap > 0; gap /= 3)
        for (int64_t start = gap; start < count; start++)
            for (int64_t i = start; i >= gap && comes_after(crossings[i - gap], crossings[i]); i -= gap) {
                Crossing kept = crossings[i];
                crossings[i] = crossings[i - gap];
                crossings[i - gap] = kept;
            }
}

} // namespace radarsim

namespace embree {

constexpr uint32_t INVALID = 0xFFFFFFFF; // Embree's number for "none", and its mask of all bits

struct Ray {
    float org[3], tnear, dir[3], time, tfar;
    uint32_t mask, id, flags;
};
struct Hit {
    float ng[3], u, v;
    uint32_t prim, geom, instance, instance_prim;
};
struct alignas(16) RayHit {
    Ray ray;
    alignas(16) Hit hit;
};
struct Context {
    uint32_t instance = INVALID, instance_prim = INVALID;
};
struct Arguments {
    uint32_t flags = 0, feature_mask = INVALID;
    Context* context;
    void *filter = nullptr, *intersect = nullptr, *room[4] = {};
};
struct IntersectCall { // RTCIntersectFunctionNArguments
    int* valid;
    void* user_data;
    uint32_t prim;
    Context* context;
    RayHit* ray_hit;
    uint32_t n, geom;
};
struct Bounds {
    float lower[4], upper[4];
};
struct BoundsCall { // RTCBoundsFunctionArguments
    void* user_data;
    uint32_t prim, time_step;
    Bounds* bounds;
};
struct alignas(16) PointQuery {
    float point[3], time, radius;
};
struct alignas(16) PointQueryContext {
    float world2inst[16], inst2world[16];
    uint32_t room[64]; // zeros: no instances
};
struct PointQueryCall { // RTCPointQueryFunctionArguments
    PointQuery* query;
    void* user_data;
    uint32_t prim, geom;
};

using Intersect1 = void (*)(void* scene, RayHit*, Arguments*);
using PointQueryFunction = bool (*)(PointQueryCall*);
using RunPointQuery = bool (*)(void* scene, PointQuery*, PointQueryContext*, PointQueryFunction, void*);

} // namespace embree

namespace radarsim {

constexpr double BEHIND = -5e-324; // m, the greatest number below 0

enum Role : uint8_t { IGNORE, COLLECT, OPAQUE }; // what a ray does with a part

// Triangles, and Embree's hierarchy of boxes around them.
struct Hierarchy {
    void* scene;
    Array<const Triangle> triangles;
    Array<const uint32_t> owners; // the part of each triangle
    int64_t first_sliced;         // where its triangles begin in SceneHandle::sliced
};
LAYOUT(Hierarchy, "t t", scene, triangles, owners, first_sliced)

// Embree's functions, and the hierarchies of a scene: the first is the whole scene, the others are its slices for
// level rays.
struct SceneHandle {
    void *intersect, *point_query; // rtcIntersect1, rtcPointQuery
    Array<const uint64_t> addresses; // of the hierarchies
    Array<const double> heights;     // m, z of each slice; nan for the whole scene
    Array<const int64_t> sliced;     // indices in the whole scene of the slices' triangles
    double radius, margin;           // m: of a sphere around everything; by which boxes are wider than triangles

    const Hierarchy& operator[](int64_t row) const { return *reinterpret_cast<const Hierarchy*>(addresses[row]); }
};
LAYOUT(SceneHandle, "h h s", intersect, point_query, addresses, heights, sliced, radius, margin)

// One query. Embree hands its context to the callback, which finds the rest behind it.
struct Query {
    embree::RayHit hit;
    embree::Arguments arguments;
    embree::Context context;
    int64_t hierarchy;
    const Triangle* triangles;
    const uint32_t* owners;
    const uint8_t* roles;
    Array<Crossing> crossings;
    int64_t count; // of crossings, also of those that do not fit
    Line line;
    double near, far, window, stop_t, skipped, margin;
    uint32_t stop_part, stop_triangle;
};

// Intersect a triangle whose box the ray meets; Embree calls this. Embree is told nothing of the hit, so that it goes
// on to all boxes up to tfar.
inline void on_primitive(embree::IntersectCall* call) {
    Query& query = *reinterpret_cast<Query*>(reinterpret_cast<char*>(call->context) - offsetof(Query, context));
    uint32_t triangle = call->prim;
    double t;
    int sign = cross_triangle(query.line, query.triangles[triangle], t);
    if (sign == 0 || t < query.near || t > query.far) return;
    uint32_t part = query.owners[triangle];
    double far = query.far;
    switch (query.roles[part]) {
    case OPAQUE: {
        // The order of the calls must not matter: where two opaque surfaces coincide, the part with
        // the lower index is hit, and of its triangles the lower one.
        bool nearer = t < query.stop_t || part < query.stop_part;
        if (nearer || (part == query.stop_part && triangle < query.stop_triangle))
            query.stop_part = part, query.stop_triangle = triangle;
        query.stop_t = far = t;
        break;
    }
    case COLLECT:
        // The window begins at the nearest surface, which need not be found first.
        far = minimum(far, t + query.window);
        if (query.count < query.crossings.size()) query.crossings[query.count] = {t, int32_t(part), sign};
        query.count++; // also what does not fit: the caller allocates a longer list
        break;
    default:
        break;
    }
    if (far < query.far) {
        query.far = far;
        // Embree skips all boxes beyond. It counts from the skipped start, and in float32, for which
        // the margin makes up.
        call->ray_hit->ray.tfar = float(far - query.skipped + query.margin);
    }
}

struct BoundedTriangles {
    const Triangle* triangles;
    double margin; // m by which boxes are wider
};

// Write the bounding box of a triangle; Embree calls this.
inline void on_bounds(embree::BoundsCall* call) {
    const auto& [triangles, margin] = *static_cast<const BoundedTriangles*>(call->user_data);
    const double* p = triangles[call->prim];
    for (int axis = 0; axis < 3; axis++) {
        call->bounds->lower[axis] = float(minimum(p[axis], p[axis + 3], p[axis + 6]) - margin);
        call->bounds->upper[axis] = float(maximum(p[axis], p[axis + 3], p[axis + 6]) + margin);
    }
}

// The addresses of these callbacks, for Embree.
inline void get_callbacks(Array<int64_t> addresses) {
    addresses[0] = reinterpret_cast<int64_t>(&on_bounds);
    addresses[1] = reinterpret_cast<int64_t>(&on_primitive);
}
BIND(get_callbacks, "2")

inline void select_hierarchy(const SceneHandle& handle, Query& query, int64_t row) {
    query.hierarchy = row;
    query.triangles = handle[row].triangles.data;
    query.owners = handle[row].owners.data;
}

inline void prepare_query(const SceneHandle& handle, Query& query, Array<Crossing> crossings) {
    query.arguments = {};
    query.context = {};
    query.arguments.context = &query.context;
    query.crossings = crossings;
    query.margin = handle.margin;
    select_hierarchy(handle, query, 0);
}

// Level rays that found no slice.
struct Unsliced {
    double height, rays;
};

// Choose the hierarchy of the next queries: a slice if the ray is level and one fits.
inline void select_scene(const SceneHandle& handle, Query& query, const Vector& origin, const Vector& direction,
                         Unsliced& unsliced) {
    int64_t row = 0;
    if (direction[2] == 0.0) {
        row = handle.heights.size() - 1;
        while (row > 0 && handle.heights[row] != origin[2]) row--;
        if (row == 0)
            unsliced.height = origin[2], unsliced.rays += 1.0;
        else if (handle[row].scene == handle[0].scene)
            row = 0;
    }
    select_hierarchy(handle, query, row);
}

// The index, in the whole scene, of the last opaque triangle found.
inline int64_t opaque_triangle(const SceneHandle& handle, const Query& query) {
    if (query.hierarchy == 0) return query.stop_triangle;
    return handle.sliced[handle[query.hierarchy].first_sliced + query.stop_triangle];
}

// Let Embree traverse the scene along the direction or, with -1, against it, from near to far, m; no farther behind the
// first collected surface than the window.
inline void run_query(const SceneHandle& handle, Query& query, uint32_t parts, const uint8_t* roles,
                      const Vector& origin, const Vector& direction, double orientation, double near, double far,
                      double window) {
    query.roles = roles;
    query.count = 0;
    query.stop_part = parts; // no part has this number
    query.near = near, query.far = far, query.window = window;
    query.stop_t = INFINITE;
    query.line = project_line(origin, direction);
    // Embree counts distances from the start and forwards.
    if (orientation < 0.0) near = 0.0, far = INFINITE;
    // A start far away would be rounded to float32 too coarsely: skip to the sphere around the scene.
    double skipped = maximum(-orientation * dot(origin, direction) - handle.radius, 0.0);
    if (skipped > far) return;
    embree::Ray& ray = query.hit.ray;
    for (int axis = 0; axis < 3; axis++) {
        ray.org[axis] = float(origin[axis] + skipped * orientation * direction[axis]);
        ray.dir[axis] = float(orientation * direction[axis]);
    }
    ray.tnear = float(maximum(near - skipped - handle.margin, 0.0));
    ray.time = 0.0f;
    ray.tfar = float(far - skipped + handle.margin);
    ray.mask = embree::INVALID, ray.id = 0, ray.flags = 0;
    query.hit.hit.prim = query.hit.hit.geom = embree::INVALID;
    query.skipped = skipped;
    auto intersect = reinterpret_cast<embree::Intersect1>(handle.intersect);
    intersect(handle[query.hierarchy].scene, &query.hit, &query.arguments);
}

// Whether something opaque may be within a radius around a point; false is certain.
struct NearbySearch {
    const uint32_t* owners;
    const uint8_t* roles;
    bool found;
};

inline bool on_nearby_primitive(embree::PointQueryCall* call) {
    auto& search = *static_cast<NearbySearch*>(call->user_data);
    if (search.roles[search.owners[call->prim]] != OPAQUE) return false;
    search.found = true;
    call->query->radius = 0.0f; // one is enough: end the traversal
    return true;
}

inline bool is_opaque_nearby(const SceneHandle& handle, const uint8_t* roles, const Vector& point, double radius) {
    embree::PointQuery query = {{float(point[0]), float(point[1]), float(point[2])}, 0.0f, float(radius)};
    embree::PointQueryContext context = {};
    NearbySearch search = {handle[0].owners.data, roles, false};
    auto run = reinterpret_cast<embree::RunPointQuery>(handle.point_query);
    run(handle[0].scene, &query, &context, on_nearby_primitive, &search);
    return search.found;
}

} // namespace radarsim
