// Aim the rays of sensors: from nodes in the sensor's frame to rays in the map frame.
#pragma once
#include "door.hpp"

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
DOOR(aim_scans, "j r r r")

} // namespace radarsim
