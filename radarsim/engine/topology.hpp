// Passes over the faces of triangle meshes; see scene/topology.py for the theory.
#pragma once
#include "bindings.hpp"

namespace radarsim {

using Face = int32_t[3];

// Mixed as by splitmix64: coordinates on a grid differ in few bits.
inline uint64_t hash_of(const Vector& position) {
    uint64_t mixed = 0;
    for (double number : position.numbers) {
        mixed ^= __builtin_bit_cast(uint64_t, number + 0.0); // both zeros are equal
        mixed = (mixed ^ mixed >> 29) * 0x9E3779B97F4A7C15;
        mixed = (mixed ^ mixed >> 32) * 0xBF58476D1CE4E5B9;
    }
    return mixed ^ mixed >> 32;
}

// Number the positions of corners in the order of their first use, and keep a vertex of each. Returns how many they
// are; -1 if a corner is none of the vertices.
inline int64_t merge_vertices(Array<const Vector> vertices, Array<const int32_t> corners, Array<int32_t> merged,
                              Array<int32_t> kept) {
    uint64_t last = 1;
    while (last < 2 * uint64_t(kept.size())) last = 2 * last + 1;
    Buffer<int32_t> slots(last + 1), numbers(kept.size()); // from 1 on, 0 if free
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

struct Forest { // faces that are connected, as trees
    Array<int32_t> parents;
    Array<bool> flips; // whether the face disagrees with its parent

    // The root of a face's tree; disagree changes if the face disagrees with it.
    int32_t find_root(int32_t face, bool& disagree) const {
        while (parents[face] != face) {
            int32_t parent = parents[face];
            flips[face] ^= flips[parent];
            parents[face] = parents[parent]; // halves the way for whoever comes next
            disagree ^= flips[face];
            face = parents[face];
        }
        return face;
    }

    // Join the trees of two faces; returns whether they contradict, being of one.
    bool join(int32_t face, int32_t other, bool disagree) const {
        int32_t one = find_root(face, disagree), two = find_root(other, disagree);
        if (one == two) return disagree;
        // The lower face is the root, so that components are numbered by first faces.
        parents[maximum(one, two)] = minimum(one, two);
        flips[maximum(one, two)] = disagree;
        return false;
    }
};

// Label the faces by the components that their shared edges make, and mark those that disagree with the first one of
// their component. Returns how many components there are; -1 if a corner is none of the vertices.
inline int64_t connect_faces(Array<const int32_t> corners, int64_t vertices, Array<int32_t> labels, Array<bool> flips,
                             Array<int64_t> counts) {
    struct Edge { // from a vertex to a higher one
        int32_t first, users, balance; // its first side's place, plus 1; its sides, and how many more lead upwards
    };
    if (corners.size() != 3 * labels.size() || vertices < 0 || vertices > INT32_MAX) return -1;
    for (int32_t corner : corners)
        if (corner < 0 || corner >= vertices) return -1;
    Buffer<int32_t> starts(vertices + 2), sides(corners.size());
    Buffer<Edge> edges(vertices); // by their higher ends
    auto next = [](int32_t side) { return side % 3 < 2 ? side + 1 : side - 2; };
    auto low_end = [&](int32_t side) { return minimum(corners[side], corners[next(side)]); };
    // Sort the sides of all faces by their lower vertex: two places ahead, as a place moves on.
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
            if (edge.first <= starts[vertex]) { // left by an earlier vertex
                edge = {place + 1, 1, step};
                open_edges++, unpaired_edges++;
                continue;
            }
            edge.users++;
            unpaired_edges += int(edge.users == 3) - int(edge.users == 2);
            // Neighbours agree if they run along their edge in opposite directions.
            bool disagree = edge.balance == step;
            open_edges -= edge.balance != 0;
            edge.balance += step;
            open_edges += edge.balance != 0;
            int32_t other = sides[edge.first - 1];
            // Equal triangles share all edges: cheap to exclude here, slow to search for.
            may_coincide |= edge.users > 2 || corners[next(next(side))] == corners[next(next(other))];
            has_one_side |= forest.join(side / 3, other / 3, disagree);
        }
    int32_t components = 0;
    for (int32_t face = 0; face < labels.size(); face++) {
        int32_t parent = labels[face]; // which is labelled already
        if (parent < face) flips[face] ^= flips[parent];
        labels[face] = parent < face ? labels[parent] : components++;
    }
    counts[0] = open_edges, counts[1] = unpaired_edges, counts[2] = has_one_side, counts[3] = may_coincide;
    return components;
}
BIND(connect_faces, "c f f 4")

struct Component {
    double volume, area; // m³, negative if it is inside out; m²
    double low[3], high[3];
    Vector origin; // one of its corners, since volumes far away are inexact
};
ROW(Component, volume, area, low, high)

inline Vector cross(const Vector& a, const Vector& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// Measure components, whose labels are as above.
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
