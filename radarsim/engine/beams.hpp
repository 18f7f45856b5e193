// The directions of rays in the frame of their sensor.
#pragma once
#include "door.hpp"

namespace radarsim {

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
DOOR(node_directions, "n kn kn")

} // namespace radarsim
