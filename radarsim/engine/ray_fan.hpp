// The directions of things and of rays, seen from a sensor; see ray_fan.py for the theory.
#pragma once
#include "door.hpp"

namespace radarsim::fmcw {

// The rest of an angle, rad, from -pi to pi, as Python's remainder has it.
inline double wrapped(double angle) {
    constexpr double TURN = 2 * M_PI;
    double rest = fmod(angle + M_PI, TURN);
    return (rest < 0.0 ? rest + TURN : rest) - M_PI;
}

// Measure what directions bounding boxes take up, by lower and upper corners; see Extents.
inline void measure_extents(Array<const double[2][3]> bounds, Array<const double> position, Array<const Vector> rotation,
                            Array<double, 2> extents) {
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
        double centre = -atan2(middle[1], middle[0]), first = INFINITE, last = -INFINITE;
        low[i] = INFINITE, high[i] = -INFINITE;
        for (const Vector& corner : seen) {
            double turned = wrapped(-atan2(corner[1], corner[0]) - centre);
            double up = atan2(corner[2], hypot(corner[0], corner[1]));
            first = least(first, turned), last = most(last, turned);
            low[i] = least(low[i], up), high[i] = most(high[i], up);
        }
        azimuth[i] = centre + first, width[i] = last - first;
        extents(4, i) = sqrt(middle[0] * middle[0] + middle[1] * middle[1] + middle[2] * middle[2]);
    }
}
DOOR(measure_extents, "n 3 3 5n")

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
DOOR(turn_directions, "n r n n")

} // namespace radarsim::fmcw
