// Passes over the faces of triangle meshes; see face_passes.py for the theory.
#pragma once
#include "bindings.hpp"

namespace radarsim {

using Face = int32_t[3];

struct VertexTable {
    Array<const Vector> positions; // m, of all vertices
    Array<int32_t> slots;          // the numbers of those that are left, -1 where a slot is free
    Array<int32_t> kept;           // their indices
};

// The slot of a vertex's position, or the free one where it belongs.
inline uint64_t find_slot(const VertexTable& table, int32_t vertex) {
    // Mixed as by splitmix64: coordinates on a grid differ in few bits.
    uint64_t mixed = 0;
    const Vector& position = table.positions[vertex];
    for (int axis = 0; axis < 3; axis++) {
        if (position[axis] != 0.0) mixed ^= __builtin_bit_cast(uint64_t, position[axis]); // both zeros are equal
        mixed *= 0x9E3779B97F4A7C15;
        mixed ^= mixed >> 29;
        mixed *= 0xBF58476D1CE4E5B9;
        mixed ^= mixed >> 32;
    }
    uint64_t last = table.slots.size() - 1, slot = mixed & last;
    while (table.slots[slot] >= 0) {
        const Vector& other = table.positions[table.kept[table.slots[slot]]];
        if (other[0] == position[0] && other[1] == position[1] && other[2] == position[2]) break;
        slot = (slot + 1) & last;
    }
    return slot;
}

inline bool has_corners(const Face& face, int64_t vertices) {
    return uint64_t(face[0]) < uint64_t(vertices) && uint64_t(face[1]) < uint64_t(vertices) &&
           uint64_t(face[2]) < uint64_t(vertices);
}

// Number the vertices, and write the faces that keep their corners. Returns the number of faces, and that of
// vertices in count; -1 if there are too few slots, whose number is a power of two.
inline int64_t merge_vertices(Array<const Vector> positions, Array<const Face> faces, Array<int32_t> slots,
                              Array<int32_t> kept, Array<int32_t> numbers, Array<Face> merged, Array<int64_t> count) {
    VertexTable table = {positions, slots, kept};
    int64_t rows = 0, vertices = 0;
    if (slots.size() & (slots.size() - 1)) return -1; // no power of two
    for (const Face& face : faces) {
        // Three quarters full: probes become long, so begin again with more slots.
        if (4 * vertices > 3 * slots.size() - 12) return -1;
        if (!has_corners(face, positions.size())) continue;
        Face& corners = merged[rows];
        for (int corner = 0; corner < 3; corner++) {
            int32_t vertex = face[corner];
            if (numbers[vertex] < 0) {
                uint64_t slot = find_slot(table, vertex);
                if (slots[slot] < 0) {
                    slots[slot] = int32_t(vertices);
                    kept[vertices++] = vertex;
                }
                numbers[vertex] = slots[slot];
            }
            corners[corner] = numbers[vertex];
        }
        if (corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0]) rows++;
    }
    count[0] = vertices;
    return rows;
}
BIND(merge_vertices, "v f s v v f 1")

struct Forest { // faces that are connected, as trees
    Array<int32_t> parents;
    Array<bool> flips; // whether the face disagrees with its parent
};
struct Root {
    int32_t face;
    bool flipped;
};

inline int next_corner(int corner) { return corner < 2 ? corner + 1 : 0; }

inline Root find_root(const Forest& forest, int32_t face) {
    const auto& [parents, flips] = forest;
    bool flipped = false;
    while (parents[face] != face) {
        int32_t parent = parents[face];
        flips[face] ^= flips[parent];
        parents[face] = parents[parent]; // halves the way for whoever comes next
        flipped ^= flips[face];
        face = parents[face];
    }
    return {face, flipped};
}

// Join the trees of two faces; returns whether they contradict, being of one.
inline bool join_faces(const Forest& forest, int32_t face, int32_t other, bool disagree) {
    Root one = find_root(forest, face), two = find_root(forest, other);
    bool roots_disagree = disagree ^ one.flipped ^ two.flipped;
    if (one.face == two.face) return roots_disagree;
    int32_t low = minimum(one.face, two.face), high = one.face + two.face - low;
    // The lower face is the root, so that components are numbered by first faces.
    forest.parents[high] = low;
    forest.flips[high] = roots_disagree;
    return false;
}

// Unite the faces that share edges. Edges hold, for each other end of those at a vertex, the place of its first
// side, the number of its sides, and how much more often it is run along upwards.
inline bool unite_faces(Array<const Face> faces, Array<int32_t> sides, Array<int32_t> starts, Array<int32_t, 2> edges,
                        Array<int32_t> parents, Array<bool> flips, Array<int64_t> counts) {
    auto low_end = [&](int64_t face, int corner) {
        return minimum(faces[face][corner], faces[face][next_corner(corner)]);
    };
    int64_t vertices = edges.shape[1];
    if (starts.size() != vertices + 2 || sides.size() < 3 * faces.size()) return false;
    for (const Face& face : faces)
        if (!has_corners(face, vertices)) return false;
    // Sort the sides of all faces by their lower vertex: two places ahead, as a place moves on.
    for (int64_t face = 0; face < faces.size(); face++)
        for (int corner = 0; corner < 3; corner++) starts[low_end(face, corner) + 2]++;
    for (int64_t vertex = 1; vertex < vertices + 2; vertex++) starts[vertex] += starts[vertex - 1];
    for (int64_t face = 0; face < faces.size(); face++)
        for (int corner = 0; corner < 3; corner++)
            sides[starts[low_end(face, corner) + 1]++] = int32_t(3 * face + corner);
    int32_t *places = &edges(0, 0), *users = &edges(1, 0), *balance = &edges(2, 0);
    int64_t open_edges = 0, unpaired_edges = 0;
    bool has_one_side = false, may_coincide = false;
    for (int64_t vertex = 0; vertex < vertices; vertex++)
        for (int32_t place = starts[vertex]; place < starts[vertex + 1]; place++) {
            int32_t face = sides[place] / 3;
            int corner = sides[place] % 3;
            int32_t begin = faces[face][corner], end = faces[face][next_corner(corner)];
            int32_t high = begin < end ? end : begin, step = begin < end ? 1 : -1;
            if (places[high] < starts[vertex]) { // left by an earlier vertex
                places[high] = place, users[high] = 1, balance[high] = step;
                open_edges++, unpaired_edges++;
                continue;
            }
            users[high]++;
            unpaired_edges += int(users[high] == 3) - int(users[high] == 2);
            // Neighbours agree if they run along their edge in opposite directions.
            bool disagree = balance[high] == step;
            open_edges -= balance[high] != 0;
            balance[high] += step;
            open_edges += balance[high] != 0;
            int32_t other = sides[places[high]] / 3;
            int opposite = next_corner(next_corner(sides[places[high]] % 3));
            // Equal triangles share all edges: cheap to exclude here, slow to search for.
            may_coincide |= users[high] > 2;
            may_coincide |= faces[other][opposite] == faces[face][next_corner(next_corner(corner))];
            has_one_side |= join_faces({parents, flips}, face, other, disagree);
        }
    counts[0] = open_edges, counts[1] = unpaired_edges, counts[2] = has_one_side, counts[3] = may_coincide;
    return true;
}
BIND(unite_faces, "f s t 3v f f 4")

// Fill labels, and make flips relative to roots; returns how many components there are.
inline int64_t label_faces(Array<int32_t> parents, Array<bool> flips, Array<int32_t> labels) {
    int32_t components = 0;
    for (int32_t face = 0; face < labels.size(); face++) {
        Root root = find_root({parents, flips}, face);
        parents[face] = root.face;
        flips[face] = root.flipped;
        labels[face] = root.face == face ? components++ : labels[root.face];
    }
    return components;
}
BIND(label_faces, "f f f")

inline void measure_components(Array<const Vector> vertices, Array<const Face> faces, Array<const int32_t> labels,
                               Array<const Vector> origins, Array<double> volumes, Array<double> areas,
                               Array<Vector> lows, Array<Vector> highs) {
    for (int64_t face = 0; face < faces.size(); face++) {
        int32_t label = labels[face];
        if (!has_corners(faces[face], vertices.size()) || label < 0 || label >= origins.size()) continue;
        const Vector &a = vertices[faces[face][0]], &b = vertices[faces[face][1]], &c = vertices[faces[face][2]];
        for (int axis = 0; axis < 3; axis++) {
            double &low = lows[label][axis], &high = highs[label][axis];
            low = minimum(minimum(low, a[axis], b[axis]), c[axis]);
            high = maximum(maximum(high, a[axis], b[axis]), c[axis]);
        }
        double volume = 0.0, square = 0.0;
        for (int x = 0; x < 3; x++) {
            int y = next_corner(x), z = next_corner(y);
            double ax = a[x] - origins[label][x], oy = origins[label][y], oz = origins[label][z];
            double ay = a[y] - oy, az = a[z] - oz, by = b[y] - oy, bz = b[z] - oz, cy = c[y] - oy, cz = c[z] - oz;
            volume += ax * (by * cz - bz * cy);
            double normal = (by - ay) * (cz - az) - (bz - az) * (cy - ay);
            square += normal * normal;
        }
        volumes[label] += volume / 6.0;
        areas[label] += sqrt(square) / 2.0;
    }
}
BIND(measure_components, "v f f c c c c c")

} // namespace radarsim
