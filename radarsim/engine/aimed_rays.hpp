// Aim the rays of sensors: from nodes in the sensor's frame to rays in the map frame.
#pragma once
#include "door.hpp"

namespace radarsim {

struct Place { // of a sensor: map frame, and the id of the box that carries it
    double x, y, z, roll, pitch, yaw, carrier;
};

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

enum Choice : int64_t { DRAWN, ALL, GIVEN };

// Select the rays of scans, and transform them to the map frame; see aimed_rays.py. Returns whether the lengths of the
// arrays, and nodes that are given, belong together.
inline bool aim_scans(const NodeTable& table, Array<const double[6]> poses, Choice choice, Array<const double, 2> chances,
                      Array<int16_t> nodes, Array<int8_t> sides, Array<Vector> origins, Array<Vector> directions) {
    int64_t beams = poses.size() * table.beams(), all = table.nodes(), i = 0;
    if (!beams || !table.is_valid()) return !nodes.size();
    int64_t rays_per_beam = nodes.size() / beams;
    if (nodes.size() % beams || (choice == ALL && rays_per_beam > all)) return false;
    bool is_drawn = chances.shape[0] == poses.size() && chances.shape[1] == table.beams() && table.edges.size() < all;
    if (choice == DRAWN && !(is_drawn && rays_per_beam == 1)) return false;
    for (int16_t node : nodes)
        if (choice == GIVEN && (node < 0 || node >= all)) return false;
    for (int64_t scan = 0; scan < poses.size(); scan++) {
        const double* p = poses[scan];
        Frame frame = frame_of({p[0], p[1], p[2], p[3], p[4], p[5], -1.0});
        for (int64_t beam = 0; beam < table.beams(); beam++)
            for (int64_t ray = 0; ray < rays_per_beam; ray++, i++) {
                if (choice == DRAWN)
                    nodes[i] = int16_t(node_of(table.edges, chances(scan, beam)));
                else if (choice == ALL)
                    nodes[i] = int16_t(ray);
                sides[i] = table.sides[nodes[i]];
                aim_ray(table, frame, beam, nodes[i], origins[i], directions[i]);
            }
    }
    return true;
}
DOOR(aim_scans, "j hn r r r r")

} // namespace radarsim
