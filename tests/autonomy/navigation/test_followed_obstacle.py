"""A robot circles the obstacle that it has hit, not another that is as near."""

import math

import numpy as np
import pytest
from flatland import moved, navigator

from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.plans import Algorithm
from radarsim.geometry import Floats, Point, Pose2

RADIUS = 0.1  # m, of the poles
REACH = 0.2  # m; from each beam to its side beams
BEARINGS: Floats = np.radians(np.arange(360.0) - 180.0)


def ranges(pose: Pose2, poles: list[Point]) -> Floats:
    """Return what a radar with three rays a beam measures, exactly."""
    nearest = np.full(360, math.inf)
    angles = BEARINGS + pose.yaw
    for x, y in poles:
        dx, dy = x - pose.x, y - pose.y
        along = dx * np.cos(angles) + dy * np.sin(angles)
        aside = dy * np.cos(angles) - dx * np.sin(angles)
        for offset in (-REACH, 0.0, REACH):
            square = RADIUS**2 - (aside - offset) ** 2
            met = along - np.sqrt(np.maximum(square, 0))
            seen = (square > 0) & (along > 0)
            nearest = np.where(seen, np.minimum(nearest, met), nearest)
    return nearest


def turn_about(pole: Point, before: Pose2, after: Pose2) -> float:
    """Return by how much a robot went around a pole, in turns."""
    angles = (math.atan2(p.y - pole[1], p.x - pole[0]) for p in (before, after))
    begin, end = angles
    return math.remainder(end - begin, math.tau) / math.tau


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("direction", [0.8, -1.0])
def test_first_of_two_poles_is_circled(seed: int, direction: float) -> None:
    poles = [(0.0, 0.0), (1.75 * math.cos(direction), 1.75 * math.sin(direction))]
    rng, pose = np.random.default_rng(seed), Pose2(-4.0, 0.01 * seed)
    bug = navigator(Algorithm.BUG1, (6.0, 0.0), wall_on_left=seed % 2 == 0)
    turns = [0.0, 0.0]
    for k in range(1500):
        noisy = ranges(pose, poles) + rng.normal(0, 0.02, 360)
        twist = bug.step(Observation(k * 0.1, pose, BEARINGS, noisy))
        if bug.is_done:
            break
        before, pose = pose, moved(pose, twist)
        if not bug.circuits:
            for i, pole in enumerate(poles):
                turns[i] += turn_about(pole, before, pose)
    assert bug.is_done
    assert abs(turns[0]) > 0.9
    assert abs(turns[1]) < 0.5
