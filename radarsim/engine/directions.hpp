// Directions of rays: in the sensor frame, in the map frame, and for the ray fan of an FMCW radar (see ray_fan.py).
#pragma once
#include "path_search.hpp"

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

struct Extent { // a bounding box as seen from an antenna, rad
    double azimuth, width; // azimuth at which it begins, clockwise from straight ahead
    double low, high;      // elevations of the edges
};

// Return the extent of a bounding box, which is given by its lower and upper corner.
inline Extent extent_of(const Vector (&bounds)[2], const Vector& position, Array<const Vector> rotation) {
    Vector seen[8] = {}, middle = {};
    for (int corner = 0; corner < 8; corner++) {
        for (int axis = 0; axis < 3; axis++) {
            double offset = bounds[corner >> axis & 1][axis] - position[axis];
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
    return {first - atan2(middle[1], middle[0]), last - first, atan(bottom), atan(top)};
}

// The numbers of rays on objects; see ray_fan.py.
constexpr double ENOUGH_RAYS = 32.0; // rays on an object in a beam, for an error of at most 1 dB
constexpr double RAYS_ACROSS = 10.0; // rays in azimuth on the bounding box of a thin object
constexpr double RAYS_UP = 8.0;      // rays in elevation on the bounding box of a thin object
constexpr double MOST_PARTS = 40.0;  // maximum number of parts of a cell in each angle
constexpr double MOST_RAYS = 1e5;    // maximum number of added rays; nearest objects come first

// Find into how many parts, in both angles, the cells of some columns are divided: around an object that few rays would
// hit, a rectangle of cells is divided. The borders are the elevations between the cells, first is the first of the
// columns, and the circle has count columns. Returns whether the numbers are valid.
inline bool divide_cells(Array<const Vector[2]> bounds, Array<const Vector> position, Array<const Vector> rotation,
                         Array<const double> borders, double beamwidth, int64_t first, int64_t count,
                         Array<int64_t, 2> across, Array<int64_t, 2> up) {
    int64_t columns = across.shape[0], rows = across.shape[1];
    if (borders.size() != rows + 1 || first < 0 || first >= count || count > INT32_MAX) return false;
    double width = 2 * M_PI / count, beam = beamwidth / width, added = 0.0;
    auto row_at = [&](double elevation) {
        int64_t row = first_where(0, rows + 1, [&](int64_t i) { return borders[i] > elevation; }) - 1;
        if (row < 0 || row == rows) return double(row < 0 ? 0 : rows);
        return 1.0 / (borders[row + 1] - borders[row]) * (elevation - borders[row]) + row;
    };
    auto parts_of = [](double wanted, double size) { return minimum(ceil(wanted / maximum(size, 1e-9)), MOST_PARTS); };
    Heap<QueuedCell> nearest;
    for (int64_t i = 0; i < bounds.size(); i++)
        nearest.push({length_of((bounds[i][0] + bounds[i][1]) / 2.0 - position[0]), i});
    while (!nearest.is_empty()) {
        Extent seen = extent_of(bounds[nearest.pop().cell], position[0], rotation);
        double low = row_at(seen.low), high = row_at(seen.high), wide = seen.width / width, tall = high - low;
        // Only the part of an object inside the beam counts for an azimuth.
        bool is_thin = minimum(wide, beam) * tall < ENOUGH_RAYS && tall > 0.0 && low >= 0.0 && high <= rows;
        if (!is_thin || !(seen.width < M_PI) || !isfinite(seen.azimuth)) continue;
        // The first column may be negative, and the last one beyond the full circle.
        double begin = floor(seen.azimuth / width), end = floor((seen.azimuth + seen.width) / width);
        double aside = parts_of(RAYS_ACROSS, wide), above = parts_of(RAYS_UP, tall);
        int64_t bottom = int64_t(low), top = int64_t(ceil(high));
        added += (end - begin + 1.0) * double(top - bottom) * aside * above;
        if (added > MOST_RAYS) break;
        int64_t start = ((int64_t(begin) - first) % count + count) % count;
        for (int64_t place = start; place <= start + int64_t(end - begin); place++) {
            int64_t column = place % count;
            if (column >= columns) place += count - 1 - column; // to the first column, if the object reaches it
            for (int64_t row = bottom; row < top && column < columns; row++) {
                across(column, row) = maximum(across(column, row), int64_t(aside));
                up(column, row) = maximum(up(column, row), int64_t(above));
            }
        }
    }
    return true;
}
BIND(divide_cells, "n 1 3 b cr cr")

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
