// What happens to rays on their way.
#pragma once
#include "door.hpp"

namespace radarsim {

enum class Kind : int32_t { // an EventKind
    START_INSIDE,
    ENTER,
    LEAVE,
    SHEET,
    HIT,
    SPENT,
    OUT_OF_RANGE,
    MIRRORED,
    ABSORBED,
    RAIN,
    NONE = -1
};

struct Event { // a row of EVENT
    int64_t ray;
    double t; // m from the ray's origin
    int32_t part;
    Kind kind;
    double power, absorbed, x, y, z;
};
LAYOUT(Event, "", ray, t, part, kind, power, absorbed, x, y, z)

} // namespace radarsim
