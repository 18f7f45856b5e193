// The directions of rays: in the frame of their sensor, aimed in the map frame, and those of a fan (see ray_fan.py).
#pragma once
#include "bindings.hpp"

namespace radarsim {

struct Place { // of a sensor: map frame, and the id of the box that carries it
    double x, y, z, roll, pitch, yaw, carrier;
};

inline const Place& place_of(Array<const double[7]> places, int64_t scan) {
    return *reinterpret_cast<const Place*>(places[scan]);
}

struct NodeTable {
    Array<const Vector, 2> directions, starts; // of each node and beam; one row of starts if all nodes share them
    Array<const double> edges;                 // random numbers from which on the next node is drawn
    Array<const int8_t> sides;                 // of each node

    int64_t nodes() const { return sides.size() < directions.shape[0] ? sides.size() : directions.shape[0]; }
    int64_t beams() const { return directions.shape[1]; }
    // Whether there are starts for all nodes, and numbers of nodes fit into 16 bits.
    bool is_valid() const {
        return (starts.shape[0] == 1 || starts.shape[0] == directions.shape[0]) && directions.shape[0] <= INT16_MAX;
    }
};
LAYOUT(NodeTable, "kn sn e m", directions, starts, edges, sides)

struct Frame {
    Vector position;
    double rotation[3][3];
};

// The node that a random number selects: how many edges it has reached.
inline int64_t node_of(Array<const double> edges, double chance) {
    int64_t low = 0, high = edges.size();
    while (low < high) {
        int64_t middle = (low + high) / 2;
        // An edge itself belongs to the node after it, as in numpy.searchsorted from the right.
        if (edges[middle] <= chance)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

// Equals geometry.rotation_matrix: scans in batches and alone agree bit by bit.
inline Frame frame_of(const Place& place) {
    double cr = cos(place.roll), sr = sin(place.roll);
    double cp = cos(place.pitch), sp = sin(place.pitch);
    double cy = cos(place.yaw), sy = sin(place.yaw);
    return {{place.x, place.y, place.z},
            {{cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr},
             {sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr},
             {-sp, cp * sr, cp * cr}}};
}

inline void aim_ray(const NodeTable& table, const Frame& frame, int64_t beam, int64_t node, Vector& origin,
                    Vector& direction) {
    const Vector& start = table.starts(table.starts.shape[0] > 1 ? node : 0, beam);
    const Vector& ahead = table.directions(node, beam);
    for (int i = 0; i < 3; i++) {
        auto& [x, y, z] = frame.rotation[i];
        // The sums begin with 0.0, so that none of them is -0.0.
        origin[i] = frame.position[i] + (0.0 + x * start[0] + y * start[1] + z * start[2]);
        direction[i] = 0.0 + x * ahead[0] + y * ahead[1] + z * ahead[2];
    }
}

// Aim nodes of scans: transform them to the map frame. Returns whether the lengths of the arrays, and the nodes, belong
// together.
inline bool aim_scans(const NodeTable& table, Array<const double[7]> places, Array<const int16_t> nodes,
                      Array<Vector> origins, Array<Vector> directions) {
    int64_t beams = places.size() * table.beams(), i = 0;
    if (!beams || !table.is_valid()) return !nodes.size();
    int64_t rays_per_beam = nodes.size() / beams;
    if (nodes.size() % beams) return false;
    for (int16_t node : nodes)
        if (node < 0 || node >= table.nodes()) return false;
    for (int64_t scan = 0; scan < places.size(); scan++) {
        Frame frame = frame_of(place_of(places, scan));
        for (int64_t beam = 0; beam < table.beams(); beam++)
            for (int64_t ray = 0; ray < rays_per_beam; ray++, i++)
                aim_ray(table, frame, beam, nodes[i], origins[i], directions[i]);
    }
    return true;
}
BIND(aim_scans, "j r r r")

// Offsets are angles to the left and up, rad, of each node of each beam.
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

// Measure what directions bounding boxes take up, by lower and upper corners; see Extents.
inline void measure_extents(Array<const double[2][3]> bounds, Array<const double> position,
                            Array<const Vector> rotation, Array<double, 2> extents) {
    double *azimuth = &extents(0, 0), *width = &extents(1, 0), *low = &extents(2, 0), *high = &extents(3, 0);
    for (int64_t i = 0; i < bounds.size(); i++) {
        double seen[8][3] = {}, middle[3] = {};
        for (int corner = 0; corner < 8; corner++)
            for (int k = 0; k < 3; k++) {
                for (int axis = 0; axis < 3; axis++)
                    seen[corner][k] += (bounds[i][corner >> axis & 1][axis] - position[axis]) * rotation[axis][k];
                middle[k] += seen[corner][k];
            }
        for (double& coordinate : middle) coordinate /= 8.0;
        // Angles from the middle are in the order of their tangents, but for a box around the antenna.
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
        extents(4, i) = sqrt(middle[0] * middle[0] + middle[1] * middle[1] + middle[2] * middle[2]);
    }
}
BIND(measure_extents, "n 3 3 5n")

// Turn unit vectors of a sensor to the map frame, each by one of some rotations. Returns whether all of these exist.
inline bool turn_directions(Array<const Vector> directions, Array<const double[3][3]> rotations,
                            Array<const int64_t> which, Array<Vector> turned) {
    for (int64_t ray = 0; ray < directions.size(); ray++) {
        if (which[ray] < 0 || which[ray] >= rotations.size()) return false;
        const auto& rotation = rotations[which[ray]];
        double square = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            double part = directions[ray][0] * rotation[axis][0] + directions[ray][1] * rotation[axis][1];
            part += directions[ray][2] * rotation[axis][2];
            turned[ray][axis] = part;
            square += part * part;
        }
        // Rounding of the product must not make the vectors longer.
        double length = sqrt(square);
        for (double& part : turned[ray]) part /= length;
    }
    return true;
}
BIND(turn_directions, "n r n n")

} // namespace radarsim
