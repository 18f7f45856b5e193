// Directions of rays: in the sensor frame, in the map frame, and for the ray fan of an FMCW radar (see ray_fan.py).
#pragma once
#include "bindings.hpp"

namespace radarsim {

struct Place { // pose of a sensor in the map frame, and the id of the robot box that carries it
    double x, y, z, roll, pitch, yaw, carrier;
};

inline const Place& place_of(Array<const double[7]> places, int64_t scan) {
    return *reinterpret_cast<const Place*>(places[scan]);
}

struct NodeTable {
    Array<const Vector, 2> directions, starts; // by node and beam; starts have a single row if all nodes share them
    Array<const double> edges;                 // ascending random numbers at which the next node begins
    Array<const int8_t> sides;                 // side of each node: -1 right, 0 centre, 1 left

    int64_t nodes() const { return sides.size() < directions.shape[0] ? sides.size() : directions.shape[0]; }
    int64_t beams() const { return directions.shape[1]; }
    // Whether the table has a start for each node, and the indices of nodes fit into 16 bits.
    bool is_valid() const {
        return (starts.shape[0] == 1 || starts.shape[0] == directions.shape[0]) && directions.shape[0] <= INT16_MAX;
    }
};
LAYOUT(NodeTable, "kn sn e m", directions, starts, edges, sides)

struct Frame {
    Vector position;
    Vector rotation[3]; // rows of the rotation matrix
};

// Return the index of the node that a random number selects: the number of edges that are not greater than it.
inline int64_t node_of(Array<const double> edges, double chance) {
    // A number equal to an edge selects the node after the edge, as numpy.searchsorted does with side="right". The
    // search has no branches, since processors cannot predict branches on random numbers.
    const double* edge = edges.data;
    int64_t left = edges.size();
    for (; left > 1; left -= left / 2) edge += left / 2 * (edge[left / 2 - 1] <= chance);
    return edge - edges.data + (left && *edge <= chance);
}

// The rotation is the same as in geometry.rotation_matrix, so single scans and batches of scans are equal bit by bit.
inline Frame frame_of(const Place& place) {
    double cr = cos(place.roll), sr = sin(place.roll);
    double cp = cos(place.pitch), sp = sin(place.pitch);
    double cy = cos(place.yaw), sy = sin(place.yaw);
    return {{place.x, place.y, place.z},
            {{cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr},
             {sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr},
             {-sp, cp * sr, cp * cr}}};
}

// Compute the rotation matrices for roll, pitch and yaw in rad.
inline void fill_rotations(Array<const Vector> angles, Array<Vector[3]> rotations) {
    for (int64_t i = 0; i < angles.size(); i++) {
        auto [roll, pitch, yaw] = angles[i].numbers;
        Frame frame = frame_of({0.0, 0.0, 0.0, roll, pitch, yaw, -1.0});
        for (int row = 0; row < 3; row++) rotations[i][row] = frame.rotation[row];
    }
}
BIND(fill_rotations, "n n")

inline void aim_ray(const NodeTable& table, const Frame& frame, int64_t beam, int64_t node, Vector& origin,
                    Vector& direction) {
    const Vector& start = table.starts(table.starts.shape[0] > 1 ? node : 0, beam);
    const Vector& ahead = table.directions(node, beam);
    for (int i = 0; i < 3; i++) {
        // Adding 0.0 turns -0.0 into 0.0.
        origin[i] = frame.position[i] + (dot(frame.rotation[i], start) + 0.0);
        direction[i] = dot(frame.rotation[i], ahead) + 0.0;
    }
}

// Compute the directions of nodes in the sensor frame. Offsets are angles to the left and up from the beam, rad, by
// node and beam.
inline void node_directions(Array<const double> angles, Array<const double[2], 2> offsets,
                            Array<Vector, 2> directions) {
    for (int64_t k = 0; k < offsets.size(); k++)
        for (int64_t i = 0; i < angles.size(); i++) {
            auto& [aside, up] = offsets(k, i);
            double azimuth = angles[i] + aside, level = cos(up);
            Vector& direction = directions(k, i);
            direction[0] = level * cos(azimuth);
            direction[1] = level * sin(azimuth);
            direction[2] = sin(up);
        }
}
BIND(node_directions, "n kn kn")

// Compute the ranges of azimuth and elevation that bounding boxes cover as seen from the antenna; see ray_fan.py. A box
// is given by its lower and upper corner.
inline void measure_extents(Array<const Vector[2]> bounds, Array<const double> position,
                            Array<const Vector> rotation, Array<double, 2> extents) {
    double *azimuth = &extents(0, 0), *width = &extents(1, 0), *low = &extents(2, 0), *high = &extents(3, 0);
    for (int64_t i = 0; i < bounds.size(); i++) {
        Vector seen[8] = {}, middle = {};
        for (int corner = 0; corner < 8; corner++) {
            for (int axis = 0; axis < 3; axis++) {
                double offset = bounds[i][corner >> axis & 1][axis] - position[axis];
                seen[corner] = seen[corner] + offset * rotation[axis];
            }
            middle = middle + seen[corner];
        }
        middle = middle / 8.0;
        // Tangents are compared, which have the same order as the angles from the middle, except for a box around the
        // antenna.
        double first = INFINITE, last = -INFINITE, bottom = INFINITE, top = -INFINITE;
        auto ahead = [&](const Vector& corner) { return middle[0] * corner[0] + middle[1] * corner[1]; };
        auto right = [&](const Vector& corner) { return middle[1] * corner[0] - middle[0] * corner[1]; };
        bool is_around = false;
        for (const Vector& corner : seen) is_around |= ahead(corner) <= 0.0;
        for (const Vector& corner : seen) {
            double side = is_around ? atan2(right(corner), ahead(corner)) : right(corner) / ahead(corner);
            double up = corner[2] / sqrt(corner[0] * corner[0] + corner[1] * corner[1]);
            first = minimum(first, side), last = maximum(last, side);
            bottom = minimum(bottom, up), top = maximum(top, up);
        }
        if (!is_around) first = atan(first), last = atan(last);
        azimuth[i] = first - atan2(middle[1], middle[0]), width[i] = last - first;
        low[i] = atan(bottom), high[i] = atan(top);
    }
}
BIND(measure_extents, "n 3 3 4n")

// Rotate unit vectors from the sensor frame to the map frame. The value which[i] is the index of the rotation for
// vector i. Returns whether all indices are valid.
inline bool turn_directions(Array<const Vector> directions, Array<const Vector[3]> rotations,
                            Array<const int64_t> which, Array<Vector> turned) {
    for (int64_t ray = 0; ray < directions.size(); ray++) {
        if (which[ray] < 0 || which[ray] >= rotations.size()) return false;
        const auto& [x, y, z] = rotations[which[ray]];
        Vector product = {dot(directions[ray], x), dot(directions[ray], y), dot(directions[ray], z)};
        turned[ray] = product / length_of(product); // corrects rounding errors of the length
    }
    return true;
}
BIND(turn_directions, "n r n n")

} // namespace radarsim
