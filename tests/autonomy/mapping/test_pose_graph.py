"""Pose graphs, and loops that they close."""

import math
from itertools import pairwise

import numpy as np
import pytest

from radarsim.autonomy.mapping.pose_graph import (
    Edge,
    KeyframeGraph,
    optimize,
    squared_errors,
)
from radarsim.geometry import Floats, Pose2

SIDE = 10  # motions along each side of a square of 10 m
SURE = np.diag([1e4, 1e4, 1e6])


def square() -> list[Pose2]:
    """Drive once around a square, and back to where it began."""
    poses = [Pose2(0.0, 0.0)]
    for k in range(4 * SIDE):
        turn = math.pi / 2 if k % SIDE == SIDE - 1 else 0.0
        poses.append(poses[-1].compose(Pose2(1.0, 0.0, turn)))
    return poses


def motions(poses: list[Pose2], scale: float = 1.0) -> list[Pose2]:
    steps = [b.relative_to(a) for a, b in pairwise(poses)]
    return [Pose2(scale * step.x, scale * step.y, step.yaw) for step in steps]


def rows(poses: list[Pose2]) -> Floats:
    return np.array([(pose.x, pose.y, pose.yaw) for pose in poses])


def test_exact_motions_give_the_true_poses_from_a_poor_guess() -> None:
    true = square()
    edges = [Edge(i, i + 1, step, SURE) for i, step in enumerate(motions(true))]
    guess = rows(true) + np.linspace(0.0, 0.4, len(true))[:, None]
    found = optimize(guess, edges)
    assert found[:, :2] == pytest.approx(rows(true)[:, :2], abs=1e-6)
    assert squared_errors(found, edges) == pytest.approx(0.0, abs=1e-6)


def test_an_error_is_spread_by_the_variances_of_the_motions() -> None:
    """Three motions along a line, one of them ten times less sure: a closed form."""
    edges = [
        Edge(0, 1, Pose2(1.0, 0.0), np.diag([100.0, 100.0, 1e4])),
        Edge(1, 2, Pose2(1.0, 0.0), np.diag([10.0, 10.0, 1e4])),
        Edge(0, 2, Pose2(2.12, 0.0), np.diag([100.0, 100.0, 1e4])),
    ]
    found = optimize(np.zeros((3, 3)), edges)
    assert found[1, 0] == pytest.approx(1.0 + 0.12 / 12)
    assert found[2, 0] == pytest.approx(2.0 + 0.12 * 11 / 12)


def closed(error: Pose2) -> list[Pose2] | None:
    """Close a square whose motions were each 3 % too long."""
    graph, pose = KeyframeGraph(), Pose2(0.0, 0.0)
    graph.add(pose)
    for step in motions(square()[: 2 * SIDE + 1], 1.03):
        graph.learn(np.array([0.03, 0.03, 0.003]), np.zeros((3, 3)))
        pose = pose.compose(step)
        graph.add(pose)
    return graph.close(0, square()[2 * SIDE].compose(error), SURE)


def test_a_closure_takes_drift_out_of_the_whole_loop() -> None:
    true, found = square()[: 2 * SIDE + 1], closed(Pose2(0.0, 0.0))
    assert found is not None
    off = np.hypot(*(rows(found) - rows(true))[:, :2].T)
    assert off[-1] < 0.1 * 0.03 * SIDE
    assert off.max() < 0.8 * 0.03 * SIDE


def test_a_closure_that_contradicts_all_motions_is_left_out() -> None:
    assert closed(Pose2(5.0, -5.0)) is None
