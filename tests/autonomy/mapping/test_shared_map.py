"""Maps of several robots: where they are on each other, and what is on them."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from flat_world import ROOM, Look, box

from radarsim.autonomy.mapping.loop_closure import Keyframe
from radarsim.autonomy.mapping.map_alignment import (
    align,
    fits,
    is_allowed,
    is_sole,
    refine,
)
from radarsim.autonomy.mapping.occupancy_grid import CellClass, OccupancyGrid
from radarsim.autonomy.mapping.scan import BeamEnd
from radarsim.autonomy.mapping.scan_grid import SharedMap, without_discs
from radarsim.autonomy.mapping.slam import Slam, SlamSettings
from radarsim.autonomy.mapping.trajectory import Trajectory
from radarsim.autonomy.navigation.plans import MotionSource
from radarsim.geometry import Floats, Pose2

POSES = [Pose2(-4.0 + 0.3 * k, 2.0 + 0.1 * k, 0.05 * k) for k in range(12)]
FRAME = Pose2(0.7, -0.5, 0.1)  # of the second robot's map on that of the first

# What is left of a wall, at x = 6, beside a door of 2 m.
DOOR: Floats = np.array([[[6, -4], [6, -2]], [[6, 0], [6, 4]]], np.float64)


def slam_of(look: Look, walls: Floats, frame: Pose2) -> Slam:
    """Let a robot drive whose own map is at a pose on the true one."""
    own = [pose.relative_to(frame) for pose in POSES]
    slam = Slam(SlamSettings(motion_source="odometry"), own[0])
    for k, (true, prior) in enumerate(zip(POSES, own, strict=True)):
        slam.step(look(walls, true, time=0.1 * k), prior)
    return slam


def keyframes_of(look: Look, walls: Floats) -> list[Keyframe]:
    return slam_of(look, walls, Pose2(0.0, 0.0)).keyframes.keyframes


def assert_near(found: Pose2 | None, distance: float) -> None:
    assert found is not None
    assert math.hypot(found.x - FRAME.x, found.y - FRAME.y) < distance
    assert found.yaw == pytest.approx(FRAME.yaw, abs=0.01)


def test_a_map_is_aligned_by_what_both_robots_see(look: Look, room: Floats) -> None:
    known = slam_of(look, room, FRAME).keyframes
    found = align(keyframes_of(look, room), known, Pose2(0.0, 0.0))
    assert_near(found, 0.05)
    assert found is not None
    assert_near(refine(keyframes_of(look, room), known, found), 0.03)


def test_a_map_is_not_aligned_along_a_corridor(look: Look, corridor: Floats) -> None:
    known = slam_of(look, corridor / 4, FRAME).keyframes
    assert align(keyframes_of(look, corridor / 4), known, Pose2(0.0, 0.0)) is None


def drive(
    look: Look, walls: Floats, poses: Sequence[Pose2], source: MotionSource
) -> Slam:
    """Let a robot drive that knows well where it is."""
    slam = Slam(SlamSettings(motion_source=source), poses[0])
    for k, pose in enumerate(poses):
        slam.step(look(walls, pose, time=0.1 * k), pose)
    return slam


def line(x: float, y: float, dx: float, count: int = 12) -> list[Pose2]:
    return [Pose2(x + dx * k, y, 0.02 * k) for k in range(count)]


@pytest.mark.parametrize("source", ["odometry", "none"])
def test_a_map_is_aligned_by_a_place_that_the_robot_has_left(
    look: Look, source: MotionSource
) -> None:
    # The second robot leaves the room, which the first one has seen, by a door.
    hidden = np.concatenate([box(9, 0, 6, 8), box(10, 2, 1, 1)])
    room = np.concatenate([ROOM[:1], ROOM[2:4], ROOM[4:], DOOR, hidden[:3], hidden[4:]])
    reference = drive(look, room, line(-4, -3, 0.2), "odometry").keyframes.keyframes
    path = [*line(2, -1, 0.3), *line(5.6, -1, 0.3)]
    known = drive(look, room, path, source).keyframes
    guesses = [Pose2(0.6, -0.4, 0.05), Pose2(-0.5, 0.3, -0.06)]
    for guess in guesses:
        tried = [align(reference, known, guess, attempt) for attempt in range(4)]
        found = [frame for frame in tried if frame is not None]
        assert found
        for frame in found:
            assert (frame.x, frame.y) == pytest.approx((0.0, 0.0), abs=0.06)
            assert frame.yaw == pytest.approx(0.0, abs=0.01)


def test_rooms_that_look_alike_are_not_taken_for_each_other(look: Look) -> None:
    # A wall of 0.12 m is between them, which each robot sees from its side.
    rooms = np.concatenate([box(x, 0, 4, 4) for x in (-2.06, 2.06)])
    desks = np.concatenate([box(x, 1.5, 1, 0.5) for x in (-2.0, 2.12)])
    walls = np.concatenate([rooms, desks])
    reference = drive(look, walls, line(-3, -1, 0.15), "odometry").keyframes.keyframes
    known = drive(look, walls, line(1.12, -1, 0.15), "odometry").keyframes
    for x, y in ((0.0, 0.0), (-1.4, 0.0), (-1.0, 0.8), (0.9, -0.4)):
        for attempt in range(4):
            assert align(reference, known, Pose2(x, y), attempt) is None


def test_a_map_is_not_aligned_farther_than_its_start_may_be_off(look: Look) -> None:
    # Two rooms, 2.2 m from each other: what is seen of one fits the other, too.
    walls = np.concatenate([box(x, 0, 2.08, 3) for x in (-1.1, 1.1)])
    desks = np.concatenate([box(x, 1.2, 0.6, 0.3) for x in (-1.4, 0.8)])
    walls = np.concatenate([walls, desks])
    reference = drive(look, walls, line(-1.6, -1, 0.06), "odometry").keyframes.keyframes
    known = drive(look, walls, line(0.6, -1, 0.06), "odometry").keyframes
    for attempt in range(2):
        assert align(reference, known, Pose2(0.0, 0.0), attempt) is None
    # Were the start off by as much as a room, that would be the place.
    found = align(reference, known, Pose2(-0.9, 0.2, 0.1))
    assert found is not None
    assert (found.x, found.y) == pytest.approx((-2.2, 0.0), abs=0.05)
    assert is_allowed(found, known, Pose2(-0.9, 0.2, 0.1))
    assert not is_allowed(found, known, Pose2(0.0, 0.0))
    assert not is_allowed(Pose2(0.0, 0.0, 0.25), known, Pose2(0.0, 0.0))


def test_walls_in_the_middle_of_what_others_saw_as_free_do_not_fit(
    look: Look, room: Floats
) -> None:
    reference, known = keyframes_of(look, room), slam_of(look, room, FRAME).keyframes
    assert fits(reference, known, FRAME)
    near = Pose2(FRAME.x + 0.1, FRAME.y - 0.1, FRAME.yaw + 0.01)
    assert fits(reference, known, near)
    for x, y in ((1.3, 0.0), (-1.3, 0.0), (0.0, 1.0)):
        assert not fits(reference, known, Pose2(FRAME.x + x, FRAME.y + y, FRAME.yaw))


def test_robots_in_view_are_no_walls_that_contradict(look: Look, room: Floats) -> None:
    # The other robot passes while this one looks; later both look through there.
    slam = Slam(SlamSettings(motion_source="odometry"), POSES[0])
    for k, pose in enumerate(POSES):
        passing = box(-2.0 + 0.4 * k, -0.5, 0.5, 0.5)
        walls = np.concatenate([room, passing]) if k < 10 else room
        slam.step(look(walls, pose, time=0.1 * k), pose)
    own = slam_of(look, room, FRAME).keyframes
    assert fits(slam.keyframes.keyframes, own, FRAME)


def test_a_map_is_not_aligned_where_two_places_fit_as_well(look: Look) -> None:
    # Equal pillars at equal distances: any two places a metre apart look the same.
    pillars = [box(x, y, 0.2, 0.2) for x in range(-60, 60) for y in (-1, 1)]
    walls = np.concatenate([*pillars, [[[-99, -2], [99, -2]], [[-99, 2], [99, 2]]]])
    reference = drive(look, walls, line(-2, 0, 0.2), "odometry").keyframes.keyframes
    known = drive(look, walls, line(-1, 0, 0.2), "odometry").keyframes
    for x in (0.0, 0.5, -0.9):
        assert align(reference, known, Pose2(x, 0.0)) is None
    # Even if it was aligned once, when less was known.
    assert not is_sole(reference, known, Pose2(0.0, 0.0), Pose2(0.5, 0.0))


def test_a_map_with_one_place_is_sure(look: Look, room: Floats) -> None:
    reference, known = keyframes_of(look, room), slam_of(look, room, FRAME).keyframes
    assert is_sole(reference, known, FRAME, Pose2(0.0, 0.0))


def test_maps_without_overlap_are_not_refined(look: Look, room: Floats) -> None:
    known = slam_of(look, room, FRAME).keyframes
    far = keyframes_of(look, room + 40.0)
    assert refine(far, known, FRAME) is None
    assert align(far, known, FRAME) is None


def test_solid_things_in_discs_are_left_out_with_what_is_behind(
    look: Look, room: Floats
) -> None:
    scan = look(room, POSES[0])
    ahead = int(np.argmin(np.abs(scan.angles)))
    place = np.array([[scan.known_range[ahead], 0.0]])
    left = without_discs(scan, place, 0.5)
    assert scan.ends[ahead] == BeamEnd.UNSURE
    assert left.ends[ahead] == BeamEnd.NOTHING
    assert left.known_range[ahead] == scan.known_range[ahead]
    assert ahead not in left.hits.beams
    gone = len(scan.hits.beams) - len(left.hits.beams)
    assert 0 < gone < 40
    assert without_discs(scan, place + 99.0, 0.5) is scan


def obstacles_near(grid: OccupancyGrid, pose: Pose2) -> int:
    x, y = grid.frame.cell_centers()
    is_near = np.hypot(x - pose.x, y[:, None] - pose.y) < 0.45
    return int(np.count_nonzero(is_near & (grid.classes() == CellClass.OBSTACLE)))


def test_scans_are_on_the_shared_map_once_it_is_known_where(
    look: Look, room: Floats
) -> None:
    shared = SharedMap(0.05)
    first, second = shared.join(0.2), shared.join(0.2)
    assert (first.is_merged, second.is_merged) == (True, False)
    mine, other = Trajectory(), Trajectory()
    # The second robot is seen by the first one, as a pillar of its size.
    true = Pose2(0.0, -3.4, 0.3)
    pillar = np.concatenate([room, box(true.x, true.y, 0.5, 0.5)])
    for k in range(8):
        other.add(0.1 * k, true.relative_to(FRAME))
        second.add(other, look(room, true, time=0.1 * k))
        mine.add(0.1 * k, POSES[0])
        first.add(mine, look(pillar, POSES[0], time=0.1 * k))
    assert obstacles_near(shared.grid, true) > 0
    before = np.count_nonzero(first.grid.sensed_cells())
    second.align(FRAME)
    first.finish()
    second.finish()
    assert first.grid is second.grid
    assert np.count_nonzero(first.grid.sensed_cells()) > before
    assert obstacles_near(first.grid, true) == 0
    on_map = second.on_map(other.poses[-1])
    assert (on_map.x, on_map.y) == pytest.approx((true.x, true.y))


def test_scans_leave_the_shared_map_when_an_alignment_is_undone(
    look: Look, room: Floats
) -> None:
    shared = SharedMap(0.05)
    first, second = shared.join(0.2), shared.join(0.2)
    mine, other = Trajectory(), Trajectory()
    for k, pose in enumerate(POSES):
        mine.add(0.1 * k, POSES[0])
        first.add(mine, look(room, POSES[0], time=0.1 * k))
        other.add(0.1 * k, pose.relative_to(FRAME))
        second.add(other, look(room, pose, time=0.1 * k))
        if k == 3:
            alone = first.grid.classes().copy()
            second.align(Pose2(FRAME.x + 1.3, FRAME.y, FRAME.yaw))
            shared.finish()
    assert second.is_merged
    assert first.grid.classes().shape != alone.shape
    second.undo_alignment()
    assert not second.is_merged
    assert second.frame is None
    assert len(second.grid.classes()) > 0
    assert second.on_map(other.poses[-1]) == other.poses[-1]
    shared.finish()
    assert first.grid is not second.grid
    # What is left is what the first robot has seen, which stood.
    assert (first.grid.classes() == alone).mean() > 0.99
    # All its scans, those from before and since, can be merged again.
    second.align(FRAME)
    shared.finish()
    assert len(shared.scans) == 2 * len(POSES)
