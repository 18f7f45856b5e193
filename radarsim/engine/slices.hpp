// Slices of triangles by level planes.
#pragma once
#include "walls.hpp"

namespace radarsim::robots {

using Corners = int32_t[3];

constexpr int64_t BLOCK = 32; // triangles of a block, see solid_mesh.py

// Whether a plane cuts a triangle; a corner in the plane counts as above it.
inline bool is_cut(const Vector& a, const Vector& b, const Vector& c, double height) {
    int above = (a[2] >= height) + (b[2] >= height) + (c[2] >= height);
    return above == 1 || above == 2;
}

// Write where a plane cuts two sides of a triangle, those at the corner that is alone on its side of the plane.
inline void cut_sides(Array<const Vector> vertices, const Corners& face, double height, Ends& cut) {
    bool above[3];
    for (int i = 0; i < 3; i++) above[i] = vertices[face[i]][2] >= height;
    int alone = above[1] == above[2] ? 0 : above[0] == above[2] ? 1 : 2;
    const Vector& first = vertices[face[alone]];
    for (int end = 0; end < 2; end++) {
        const Vector& other = vertices[face[(alone + 1 + end) % 3]];
        double share = (height - first[2]) / (other[2] - first[2]);
        for (int axis = 0; axis < 2; axis++) cut[end][axis] = first[axis] + share * (other[axis] - first[axis]);
    }
}

// Slice triangles; returns the number of segments, or -1 if a corner is not among the vertices.
inline int64_t slice_faces(Array<const Vector> vertices, Array<const Corners> faces, double height,
                           Array<Ends> segments) {
    int64_t count = 0;
    for (const Corners& face : faces) {
        for (int32_t corner : face)
            if (corner < 0 || corner >= vertices.size()) return -1;
        if (is_cut(vertices[face[0]], vertices[face[1]], vertices[face[2]], height))
            cut_sides(vertices, face, height, segments[count++]);
    }
    return count;
}
DOOR(slice_faces, "v f f")

struct SolidMesh { // triangles sorted by cells of space, and the bounds of blocks of them
    Array<const Vector> vertices;
    Array<const Corners> faces;
    Array<const int32_t> order;
    Array<const double, 2> lows, highs; // m, of x, y and z of blocks
};
LAYOUT(SolidMesh, "v f f 3b 3b", vertices, faces, order, lows, highs)

struct Area {
    double x_min, x_max, y_min, y_max; // m

    bool meets(double left, double right, double low, double high) const {
        return left <= x_max && x_min <= right && low <= y_max && y_min <= high;
    }
};

inline int compare_numbers(const void* one, const void* other) {
    int32_t a = *static_cast<const int32_t*>(one), b = *static_cast<const int32_t*>(other);
    return (a > b) - (a < b);
}

// Write numbers of the triangles that a plane cuts in blocks that reach into an area, ascending; returns how many they
// are. Those for which there is no room are only counted.
inline int64_t find_cut(const SolidMesh& mesh, const Area& area, double height, Array<int32_t> numbers) {
    const auto& [vertices, faces, order, lows, highs] = mesh;
    int64_t count = 0;
    for (int64_t block = 0; block < lows.shape[1]; block++) {
        if (!(lows(2, block) < height && height <= highs(2, block))) continue;
        if (!area.meets(lows(0, block), highs(0, block), lows(1, block), highs(1, block))) continue;
        for (int64_t i = block * BLOCK; i < (block + 1) * BLOCK && i < order.size(); i++) {
            const Corners& face = faces[order[i]];
            if (!is_cut(vertices[face[0]], vertices[face[1]], vertices[face[2]], height)) continue;
            if (count < numbers.size()) numbers[count] = order[i];
            count++;
        }
    }
    qsort(numbers.data, count < numbers.size() ? count : numbers.size(), sizeof(int32_t), compare_numbers);
    return count;
}

// Slice the triangles in an area, in the order of their numbers; returns the number of segments, or, if there may not
// be room for all, minus the room that is needed.
inline int64_t slice_area(const SolidMesh& mesh, double x_min, double x_max, double y_min, double y_max, double height,
                          Array<int32_t> numbers, Array<Ends> segments) {
    Area area = {x_min, x_max, y_min, y_max};
    int64_t found = find_cut(mesh, area, height, numbers), count = 0;
    if (found > numbers.size()) return -found;
    for (int64_t i = 0; i < found; i++) {
        Ends& cut = segments[count];
        cut_sides(mesh.vertices, mesh.faces[numbers[i]], height, cut);
        const auto& [one, other] = cut;
        count += area.meets(least(one[0], other[0]), most(one[0], other[0]), least(one[1], other[1]),
                            most(one[1], other[1]));
    }
    return count;
}
DOOR(slice_area, "s s")

// Write the numbers of the triangles that reach into a slab between two heights; returns how many they are.
inline int64_t find_in_slab(Array<const Triangle> triangles, double low, double high, Array<int64_t> numbers) {
    int64_t count = 0;
    for (int64_t i = 0; i < triangles.size(); i++) {
        double a = triangles[i][2], b = triangles[i][5], c = triangles[i][8];
        if ((a <= high || b <= high || c <= high) && (a >= low || b >= low || c >= low)) numbers[count++] = i;
    }
    return count;
}
DOOR(find_in_slab, "t t")

// Extend a box, three numbers of its lower corner and three of its upper one, to a point.
inline void extend(double* box, const Vector& point) {
    for (int axis = 0; axis < 3; axis++) { // a corner that is not known yet is nan
        if (!(box[axis] <= point[axis])) box[axis] = point[axis];
        if (!(box[axis + 3] >= point[axis])) box[axis + 3] = point[axis];
    }
}

// Write the bounding boxes of the parts of triangles within a slab: lower corner, upper corner, lower corner.
inline void clip_to_slab(Array<const Triangle> triangles, double low, double high, Array<Triangle> outlines) {
    const double heights[2] = {low, high};
    for (int64_t i = 0; i < triangles.size(); i++) {
        double* box = outlines[i];
        for (int k = 0; k < 6; k++) box[k] = NOT_A_NUMBER;
        for (int corner = 0; corner < 3; corner++) {
            const double *begin = &triangles[i][3 * corner], *end = &triangles[i][3 * ((corner + 1) % 3)];
            if (begin[2] >= low && begin[2] <= high) extend(box, {begin[0], begin[1], begin[2]});
            for (double height : heights) { // where the side crosses a face of the slab
                double before = begin[2] - height, after = end[2] - height, share = before / (before - after);
                if (!(before * after < 0.0)) continue;
                extend(box, {begin[0] + share * (end[0] - begin[0]), begin[1] + share * (end[1] - begin[1]),
                             begin[2] + share * (end[2] - begin[2])});
            }
        }
        memcpy(box + 6, box, 3 * sizeof(double));
    }
}
DOOR(clip_to_slab, "t t")

} // namespace radarsim::robots
