"""What a subscriber computes from messages of odometry; these are plain data."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from radarsim.geometry import Floats


def stamp_of(message: Any) -> float:
    """Return the time of a message, s."""
    stamp = message["header"]["stamp"]
    return round(float(stamp["sec"] + stamp["nanosec"] / 1e9), 2)


def place_of(message: Any) -> tuple[Floats, float]:
    """Return x and y, and the heading, of the pose of odometry."""
    pose = message["pose"]["pose"]
    heading = 2 * math.atan2(pose["orientation"]["z"], pose["orientation"]["w"])
    return np.array([pose["position"][axis] for axis in "xy"]), heading


def integral_of(odometry: Sequence[Any]) -> tuple[Floats, float, float]:
    """Return x and y, the heading, and the way, after all twists but the first.

    They are summed in small steps, each straight ahead.
    """
    (at, heading), before, way = place_of(odometry[0]), stamp_of(odometry[0]), 0.0
    for message in odometry[1:]:
        twist, time = message["twist"]["twist"], stamp_of(message)
        step = (time - before) / 10
        for _ in range(10):
            heading += twist["angular"]["z"] * step
            ahead = np.array([math.cos(heading), math.sin(heading)])
            at = at + twist["linear"]["x"] * step * ahead
            way += abs(twist["linear"]["x"]) * step
        before = time
    return at, heading, way
