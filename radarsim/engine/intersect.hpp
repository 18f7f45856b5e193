// Intersections of lines and triangles in float64, and Embree queries for the surfaces along a ray and near a point
// (see embree.py).
//
// The intersection test is watertight. Points are sheared so that the line becomes the third axis. The line crosses the
// triangle if the origin is inside the triangle's projection onto the first two axes, that is, on the same side of all
// three edges. The depth of the crossing is interpolated from the depths of the corners.
//
// Rule 1: each corner is sheared independently by the same operations, so its projection is the same for all triangles
// that share the corner.
//
// Rule 2: the side of an edge is the sign of a difference of two products. Rounding can make this difference zero, but
// never reverses its sign. For the triangle on the other side of the edge the difference is exactly the negative.
//
// Rule 3: if the difference is zero, the line goes through the edge. Then the line is displaced by an infinitesimal
// step along the first axis and a still smaller step along the second, the same for all triangles (simulation of
// simplicity). Hence a line through an edge or a corner crosses exactly one triangle of a surface, and any line enters
// a closed surface as often as it leaves it.
//
// Rule 4: the depth is a mean of the corners' depths with weights of equal sign, so a grazing line has no crossing
// outside of the triangle.
#pragma once
#include "bindings.hpp"

namespace radarsim {

constexpr double INFINITESIMAL = 1e-290; // displacement of a line from an edge
constexpr double TINY = 1e-30;           // smaller coordinates are set to zero

// A crossing of a ray and a surface.
struct Crossing {
    double t;     // m along the ray
    int32_t part;
    int32_t sign; // added to the part's winding number: 1 on entering, -1 on leaving
};

// A line, and the shear that maps the line to the third axis.
struct Line {
    int first, second, third; // permutation of the axes x, y, z
    double origin[3];         // m, in the permuted order
    double shear_first, shear_second;
    double scale;             // scale of depths
};

inline double flush_to_zero(double number) { return fabs(number) < TINY ? 0.0 : number; }

inline Line project_line(const Vector& origin, const Vector& direction) {
    int third = 0; // the axis with the largest component, so that no factor of the shear is greater than 1
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

// Return twice the signed area of the triangle that the origin and the edge from a to b form. The sign shows on which
// side of the edge the line passes; the area is 0 only if the edge is projected to a point.
inline double edge_side(double ax, double ay, double bx, double by) {
    double area = ax * by - ay * bx;
    if (area != 0.0) return area;
    double end = ay != by ? ay : bx, start = ay != by ? by : ax;
    if (end == start) return 0.0;
    return end > start ? INFINITESIMAL : -INFINITESIMAL;
}

// Intersect a line with a triangle. Returns 1 if the line enters through the front face, -1 if it leaves through the
// back face, 0 if it misses the triangle; t is the distance along the line.
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
    double area = a + b + c; // the terms have equal signs if the line passes all edges on the same side
    if (area == 0.0 || (minimum(a, b, c) < 0.0 && maximum(a, b, c) > 0.0)) return 0;
    t = line.scale * ((a * az + b * bz + c * cz) / area);
    return (area > 0.0) == (line.scale > 0.0) ? -1 : 1;
}

// Order of crossings: by distance, then by part, then entering before leaving.
inline bool comes_after(const Crossing& one, const Crossing& other) {
    if (one.t != other.t) return one.t > other.t;
    if (one.part != other.part) return one.part > other.part;
    return one.sign < other.sign;
}

// Shellsort with gaps of 3k + 1, which is fast for the few crossings that most rays have.
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
    uint32_t room[64]; // zero, since there are no instances
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

enum Role : uint8_t { IGNORE, COLLECT, OPAQUE }; // a ray ignores the part, collects its crossings, or ends at it

// Triangles, and Embree's bounding volume hierarchy of them.
struct Hierarchy {
    void* scene;
    Array<const Triangle> triangles;
    Array<const uint32_t> owners; // the part of each triangle
    int64_t first_sliced;         // index of the first triangle of this slice in SceneHandle::sliced
};
LAYOUT(Hierarchy, "t t", scene, triangles, owners, first_sliced)

// Embree's functions, and the hierarchies of a scene: the first is the whole scene, the others are horizontal slices
// for level rays.
struct SceneHandle {
    void *intersect, *point_query; // rtcIntersect1, rtcPointQuery
    Array<const uint64_t> addresses; // addresses of the hierarchies
    Array<const double> heights;     // m, z of each slice; nan for the whole scene
    Array<const int64_t> sliced;     // index of each triangle of a slice in the whole scene
    double radius, margin;           // m: radius of a sphere around the scene; margin of boxes around triangles

    const Hierarchy& operator[](int64_t row) const { return *reinterpret_cast<const Hierarchy*>(addresses[row]); }
};
LAYOUT(SceneHandle, "h h s", intersect, point_query, addresses, heights, sliced, radius, margin)

// The state of a query. Embree passes the context to the callback, which finds the other fields next to it.
struct Query {
    embree::RayHit hit;
    embree::Arguments arguments;
    embree::Context context;
    int64_t hierarchy;
    const Triangle* triangles;
    const uint32_t* owners;
    const uint8_t* roles;
    Array<Crossing> crossings;
    int64_t count; // number of crossings, including crossings that did not fit into the array
    Line line;
    double near, far, window, stop_t, skipped, margin;
    uint32_t stop_part, stop_triangle;
};

// Intersect a triangle whose bounding box the ray meets; Embree calls this function. The hit is not reported to Embree,
// so Embree continues to visit all boxes up to tfar.
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
        // The result must not depend on the order of calls. If opaque surfaces coincide, the ray hits the part, and
        // then the triangle, with the lower index.
        bool nearer = t < query.stop_t || part < query.stop_part;
        if (nearer || (part == query.stop_part && triangle < query.stop_triangle))
            query.stop_part = part, query.stop_triangle = triangle;
        query.stop_t = far = t;
        break;
    }
    case COLLECT:
        // The window begins at the nearest surface, but a farther surface may be found first.
        far = minimum(far, t + query.window);
        if (query.count < query.crossings.size()) query.crossings[query.count] = {t, int32_t(part), sign};
        query.count++; // counted even without room, so that the caller allocates a longer array
        break;
    default:
        break;
    }
    if (far < query.far) {
        query.far = far;
        // Embree skips all boxes beyond tfar. It measures distances from the start after skipping, in float32; the
        // margin compensates for the rounding.
        call->ray_hit->ray.tfar = float(far - query.skipped + query.margin);
    }
}

struct BoundedTriangles {
    const Triangle* triangles;
    double margin; // m, margin of the boxes
};

// Write the bounding box of a triangle; Embree calls this function.
inline void on_bounds(embree::BoundsCall* call) {
    const auto& [triangles, margin] = *static_cast<const BoundedTriangles*>(call->user_data);
    const double* p = triangles[call->prim];
    for (int axis = 0; axis < 3; axis++) {
        call->bounds->lower[axis] = float(minimum(p[axis], p[axis + 3], p[axis + 6]) - margin);
        call->bounds->upper[axis] = float(maximum(p[axis], p[axis + 3], p[axis + 6]) + margin);
    }
}

// Write the addresses of these callbacks, for Embree.
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

// Level rays without a slice at their height: the height of the last such ray, m, and the number of such rays.
struct Unsliced {
    double height, rays;
};

// Choose the hierarchy for the next queries: a slice if the ray is level and there is a slice at its height.
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

// Return the index in the whole scene of the last opaque triangle that was found.
inline int64_t opaque_triangle(const SceneHandle& handle, const Query& query) {
    if (query.hierarchy == 0) return query.stop_triangle;
    return handle.sliced[handle[query.hierarchy].first_sliced + query.stop_triangle];
}

// Let Embree traverse the scene along the direction, or against it if orientation is -1, from near to far, m, but at
// most a window beyond the first collected surface.
inline void run_query(const SceneHandle& handle, Query& query, uint32_t parts, const uint8_t* roles,
                      const Vector& origin, const Vector& direction, double orientation, double near, double far,
                      double window) {
    query.roles = roles;
    query.count = 0;
    query.stop_part = parts; // an index that no part has
    query.near = near, query.far = far, query.window = window;
    query.stop_t = INFINITE;
    query.line = project_line(origin, direction);
    // Embree's distances are not negative, so a backward query searches the whole line behind the start.
    if (orientation < 0.0) near = 0.0, far = INFINITE;
    // Rounding a distant start to float32 would be too coarse, so the ray skips to the sphere around the scene.
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

// A search for opaque triangles near a point.
struct NearbySearch {
    const uint32_t* owners;
    const uint8_t* roles;
    bool found;
};

inline bool on_nearby_primitive(embree::PointQueryCall* call) {
    auto& search = *static_cast<NearbySearch*>(call->user_data);
    if (search.roles[search.owners[call->prim]] != OPAQUE) return false;
    search.found = true;
    call->query->radius = 0.0f; // ends the traversal, since one triangle is enough
    return true;
}

// Whether an opaque surface may be within a radius around a point; there is certainly none if the result is false.
inline bool is_opaque_nearby(const SceneHandle& handle, const uint8_t* roles, const Vector& point, double radius) {
    embree::PointQuery query = {{float(point[0]), float(point[1]), float(point[2])}, 0.0f, float(radius)};
    embree::PointQueryContext context = {};
    NearbySearch search = {handle[0].owners.data, roles, false};
    auto run = reinterpret_cast<embree::RunPointQuery>(handle.point_query);
    run(handle[0].scene, &query, &context, on_nearby_primitive, &search);
    return search.found;
}

} // namespace radarsim
