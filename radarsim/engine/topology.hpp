// Topology of triangle meshes: merged vertices and connected components of faces; see scene/topology.py for the theory.
#pragma once
#include "bindings.hpp"

namespace radarsim {

using Face = int32_t[3];

// Hash a position with the mixing function of splitmix64, since coordinates on a grid differ only in a few bits.
inline uint64_t hash_of(const Vector& position) {
    uint64_t mixed = 0;
    for (double number : position.numbers) {
        mixed ^= __builtin_bit_cast(uint64_t, number + 0.0); // -0.0 becomes 0.0
        mixed = (mixed ^ mixed >> 29) * 0x9E3779B97F4A7C15;
        mixed = (mixed ^ mixed >> 32) * 0xBF58476D1CE4E5B9;
    }
    return mixed ^ mixed >> 32;
}

// Number the different positions of corners in the order of their first use, and keep a vertex for each. Returns the
// number of positions; -1 if a corner is not among the vertices.
inline int64_t merge_vertices(Array<const Vector> vertices, Array<const int32_t> corners, Array<int32_t> merged,
                              Array<int32_t> kept) {
    uint64_t last = 1;
    while (last < 2 * uint64_t(kept.size())) last = 2 * last + 1;
    Buffer<int32_t> slots(last + 1), numbers(kept.size()); // numbers from 1; 0 if free
    int32_t count = 0;
    for (int64_t i = 0; i < corners.size(); i++) {
        int32_t vertex = corners[i];
        if (uint64_t(vertex) >= uint64_t(kept.size())) return -1;
        if (!numbers[vertex]) {
            const auto& [x, y, z] = vertices[vertex].numbers;
            uint64_t slot = hash_of(vertices[vertex]) & last;
            for (; slots[slot]; slot = (slot + 1) & last) {
                const Vector& other = vertices[kept[slots[slot] - 1]];
                if (other[0] == x && other[1] == y && other[2] == z) break;
            }
            if (!slots[slot]) {
                kept[count++] = vertex;
                slots[slot] = count;
            }
            numbers[vertex] = slots[slot];
        }
        merged[i] = numbers[vertex] - 1;
    }
    return count;
}
BIND(merge_vertices, "v c c v")

struct Forest { // connected faces as trees of a union-find structure
    Array<int32_t> parents;
    Array<bool> flips; // whether the face disagrees with its parent

    // Return the root of a face's tree; disagree is flipped if the face disagrees with the root.
    int32_t find_root(int32_t face, bool& disagree) const {
        while (parents[face] != face) {
            int32_t parent = parents[face];
            flips[face] ^= flips[parent];
            parents[face] = parents[parent]; // path halving
            disagree ^= flips[face];
            face = parents[face];
        }
        return face;
    }

    // Join the trees of two faces. Returns whether the faces are already in the same tree and their orientations
    // contradict each other.
    bool join(int32_t face, int32_t other, bool disagree) const {
        int32_t one = find_root(face, disagree), two = find_root(other, disagree);
        if (one == two) return disagree;
        // The lower face becomes the root, so components are numbered in the order of their first faces.
        parents[maximum(one, two)] = minimum(one, two);
        flips[maximum(one, two)] = disagree;
        return false;
    }
};

// Label the faces by components, which shared edges connect, and mark faces whose orientation disagrees with the first
// face of their component. Returns the number of components; -1 if a corner is not among the vertices.
inline int64_t connect_faces(Array<const int32_t> corners, int64_t vertices, Array<int32_t> labels, Array<bool> flips,
                             Array<int64_t> counts) {
    struct Edge { // an edge from a vertex to a vertex with a higher index
        // Index of the first side of a face at this edge, plus 1; number of such sides; upward minus downward sides.
        int32_t first, users, balance;
    };
    if (corners.size() != 3 * labels.size() || vertices < 0 || vertices > INT32_MAX) return -1;
    for (int32_t corner : corners)
        if (corner < 0 || corner >= vertices) return -1;
    Buffer<int32_t> starts(vertices + 2), sides(corners.size());
    Buffer<Edge> edges(vertices); // edges by their higher vertex
    auto next = [](int32_t side) { return side % 3 < 2 ? side + 1 : side - 2; };
    auto low_end = [&](int32_t side) { return minimum(corners[side], corners[next(side)]); };
    // Sort the sides of all faces by their lower vertex (counting sort). Counts are stored two entries ahead, since the
    // second pass advances each start.
    for (int32_t side = 0; side < corners.size(); side++) starts[low_end(side) + 2]++;
    for (int64_t vertex = 1; vertex < vertices + 2; vertex++) starts[vertex] += starts[vertex - 1];
    for (int32_t side = 0; side < corners.size(); side++) sides[starts[low_end(side) + 1]++] = side;
    for (int32_t face = 0; face < labels.size(); face++) labels[face] = face;
    Forest forest = {labels, flips};
    int64_t open_edges = 0, unpaired_edges = 0;
    bool has_one_side = false, may_coincide = false;
    for (int64_t vertex = 0; vertex < vertices; vertex++)
        for (int32_t place = starts[vertex]; place < starts[vertex + 1]; place++) {
            int32_t side = sides[place], begin = corners[side], end = corners[next(side)], step = begin < end ? 1 : -1;
            Edge& edge = edges[maximum(begin, end)];
            if (edge.first <= starts[vertex]) { // the entry is from an earlier vertex
                edge = {place + 1, 1, step};
                open_edges++, unpaired_edges++;
                continue;
            }
            edge.users++;
            unpaired_edges += int(edge.users == 3) - int(edge.users == 2);
            // Adjacent faces agree if they traverse their edge in opposite directions.
            bool disagree = edge.balance == step;
            open_edges -= edge.balance != 0;
            edge.balance += step;
            open_edges += edge.balance != 0;
            int32_t other = sides[edge.first - 1];
            // Coincident triangles share all edges. This test excludes most meshes without such triangles, and is
            // faster than a search.
            may_coincide |= edge.users > 2 || corners[next(next(side))] == corners[next(next(other))];
            has_one_side |= forest.join(side / 3, other / 3, disagree);
        }
    int32_t components = 0;
    for (int32_t face = 0; face < labels.size(); face++) {
        int32_t parent = labels[face]; // the parent already has its label
        if (parent < face) flips[face] ^= flips[parent];
        labels[face] = parent < face ? labels[parent] : components++;
    }
    counts[0] = open_edges, counts[1] = unpaired_edges, counts[2] = has_one_side, counts[3] = may_coincide;
    return components;
}
BIND(connect_faces, "c f f 4")

struct Component {
    double volume, area; // m³, negative if the component is inside out; m²
    double low[3], high[3];
    Vector origin; // a corner, relative to which the volume is computed for accuracy
};
ROW(Component, volume, area, low, high)

inline Vector cross(const Vector& a, const Vector& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// Measure volume, area and bounds of the components with the labels from connect_faces.
inline bool measure_components(Array<const Vector> vertices, Array<const Face> faces, Array<const int32_t> labels,
                               Array<Component> components) {
    int32_t known = 0;
    for (int64_t face = 0; face < faces.size(); face++) {
        int32_t label = labels[face];
        for (int32_t corner : faces[face])
            if (corner < 0 || corner >= vertices.size()) return false;
        if (label < 0 || label > known || label >= components.size()) return false;
        Component& component = components[label];
        const Vector &a = vertices[faces[face][0]], &b = vertices[faces[face][1]], &c = vertices[faces[face][2]];
        if (label == known) {
            component.origin = a;
            for (int axis = 0; axis < 3; axis++) component.low[axis] = component.high[axis] = a[axis];
            known++;
        }
        for (int axis = 0; axis < 3; axis++) {
            double &low = component.low[axis], &high = component.high[axis];
            low = minimum(minimum(low, a[axis], b[axis]), c[axis]);
            high = maximum(maximum(high, a[axis], b[axis]), c[axis]);
        }
        component.volume += dot(a - component.origin, cross(b - component.origin, c - component.origin)) / 6.0;
        component.area += length_of(cross(b - a, c - a)) / 2.0;
    }
    return true;
}
BIND(measure_components, "v f f c")

} // namespace radarsim
