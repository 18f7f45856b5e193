"""Maps that are turned back to the pose at which they begin."""

import math

import numpy as np
import pytest
from flat_world import CORRIDOR, ROOM, look

from radarsim.autonomy.mapping.loop_closure import (
    Keyframe,
    KeyframeMap,
    find_correction,
)
from radarsim.autonomy.mapping.pose_graph import KeyframeGraph
from radarsim.autonomy.mapping.scan_matching import ScanPoints, inward_normals
from radarsim.geometry import Floats, Pose2

OFF = Pose2(0.03, -0.02, 0.01)  # of all but the first scans


def seen(walls: Floats, pose: Pose2) -> ScanPoints:
    places, along = look(walls, pose).points()
    return ScanPoints(places, along, inward_normals(places, along), 0.0, True)


def map_that_is_off(walls: Floats) -> KeyframeMap:
    known = KeyframeMap()
    for _ in range(3):
        start = Pose2(-4.0, 2.0)
        known.add(Keyframe(start, seen(walls, start), 0.0))
    for k in range(1, 9):
        pose = Pose2(-4.0 + 0.1 * k, 2.0 + 0.05 * k, 0.7 * k)
        keyframe = Keyframe(OFF.compose(pose), seen(walls, pose), 0.1 * k)
        known.add(keyframe)
    return known


def test_the_first_scans_show_by_how_much_a_map_is_off() -> None:
    found = find_correction(map_that_is_off(ROOM), 3)
    assert found is not None
    left = found.compose(OFF)
    assert math.hypot(left.x, left.y) < 0.01
    assert left.yaw == pytest.approx(0.0, abs=0.001)


def test_maps_are_not_anchored_where_the_first_scans_do_not_show_them() -> None:
    assert find_correction(map_that_is_off(CORRIDOR * 4), 3) is None
    known = map_that_is_off(ROOM)
    known.keyframes[4].is_local = False
    assert find_correction(known, 3) is None


def test_a_graph_moves_with_the_poses_that_follow_its_keyframes() -> None:
    graph = KeyframeGraph()
    for k in range(5):
        graph.learn(np.full(3, 0.01), np.eye(3))
        graph.add(Pose2(float(k), 0.0))
        graph.follow(Pose2(k + 0.5, 0.0))
    poses = graph.move(2, Pose2(0.0, 1.0, 0.0))
    assert [(pose.x, pose.y) for pose in poses] == [
        *[(0, 0), (1, 0), (2, 1), (3, 1), (4, 1)]
    ]
    followed = [(pose.x, pose.y) for pose in graph.trajectory()]
    assert followed == [(0.5, 0), (1.5, 0), (2.5, 1), (3.5, 1), (4.5, 1)]
    steps = [(edge.motion.x, edge.motion.y) for edge in graph.edges]
    assert steps == [(1, 0), (1, 1), (1, 0), (1, 0)]
