"""Maps and trajectories from reports."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from flat_world import ROOM, echoes_of, look

from radarsim.autonomy.mapping.mapper import MAX_SCANS_WITHOUT_MOTION, Mapper
from radarsim.autonomy.mapping.occupancy_grid import CellClass
from radarsim.client import ScannerInfo
from radarsim.geometry import Pose2, Pose3
from radarsim.protocol.reports import (
    EchoLine,
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Report,
    Status,
)

FAR = 20.0
BEAMS = 9
FOV = math.radians(80)
SCANNER = ScannerInfo(
    "lms200", Pose3(0.2, 0.0, 0.2), 0.1, FAR, math.radians(10), FOV, BEAMS
)
AHEAD = 4  # the beam straight ahead


def scan(time: float, ahead: float, name: str = "lms200") -> RangeScan:
    ranges = np.full(BEAMS, FAR)
    ranges[AHEAD] = ahead
    return RangeScan(time, name, math.radians(10), FOV, ranges)


def echoes(
    time: float,
    *events: tuple[float, str],
    line: int = 1,
    lines: int = 1,
    scanner: str = "lms200",
    **of: Any,
) -> EchoLine:
    """Return the echoes of a bush on the beam ahead, as line ``line`` of ``lines``."""
    seen = echoes_of(*((AHEAD, range_, kind) for range_, kind in events), **of)
    return EchoLine(time, scanner, line, lines, seen)


def no_echoes(time: float) -> EchoLine:
    return EchoLine(time, "lms200", 0, 0, None)


def ins(time: float, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> Ins:
    return Ins(time, "InsTest", Pose3(x, y, 0.0, yaw=yaw))


def truth(time: float, x: float = 0.0) -> GroundTruth:
    return GroundTruth(time, "GndTruth", Pose3(x, 0.0, 0.0))


def mapper(**overrides: Any) -> Mapper:
    return Mapper(SCANNER, **overrides)


def feed(maker: Mapper, *reports: Report) -> list[Any]:
    return [maker.take(report) for report in reports]


def class_at(maker: Mapper, x: float, y: float) -> int:
    cell = maker.grid.frame.cell(x, y)
    return CellClass.UNKNOWN if cell is None else int(maker.grid.classes()[cell])


def test_ranges_and_a_pose_make_a_map() -> None:
    maker = mapper(echo_wait=0.0)
    feed(maker, ins(0.1, 1.0, 2.0, math.pi / 2), scan(0.1, 3.0))
    assert class_at(maker, 1.0, 2.0 + 0.2 + 3.0) == CellClass.OBSTACLE
    assert class_at(maker, 1.0, 4.0) == CellClass.FREE
    assert class_at(maker, 1.0, 6.0) == CellClass.UNKNOWN
    assert maker.trajectory.poses == [Pose2(1.0, 2.0, math.pi / 2)]
    assert maker.trajectory.times == [0.1]
    assert maker.scans == 1


def test_echoes_distinguish_foliage_from_walls() -> None:
    maker = mapper()
    feed(
        maker,
        ins(0.1),
        echoes(0.1, (2.0, "enter"), (3.0, "leave"), line=1, lines=2),
        echoes(0.1, (5.0, "hit"), name="wall", material="brick", line=2, lines=2),
        scan(0.1, 5.0),
    )
    assert class_at(maker, 2.7, 0.0) == CellClass.FOLIAGE
    assert class_at(maker, 4.0, 0.0) == CellClass.FREE
    assert class_at(maker, 5.2, 0.0) == CellClass.OBSTACLE


def test_observation_contains_what_robots_cannot_enter() -> None:
    maker = mapper()
    reports: list[Report] = [
        ins(0.1),
        echoes(0.1, (1.0, "enter"), (1.5, "leave"), passes=True, line=1, lines=2),
        echoes(0.1, (2.0, "enter"), (3.0, "spent"), name="b", line=2, lines=2),
        scan(0.1, 3.0),
    ]
    *nothing, sensed = feed(maker, *reports)
    assert nothing == [None, None, None]
    assert sensed.time == 0.1
    assert sensed.pose == Pose2(0.0, 0.0)
    assert sensed.ranges[AHEAD] == pytest.approx(2.2)  # of the centre
    assert sensed.bearings[AHEAD] == pytest.approx(0.0)
    assert np.isinf(np.delete(sensed.ranges, AHEAD)).all()


def test_scans_wait_for_their_echoes() -> None:
    maker = mapper(echo_wait=0.5)
    assert feed(maker, ins(0.1), scan(0.1, 3.0)) == [None, None]
    assert "echoes" in maker.missing
    assert maker.scans == 0
    (_, sensed) = feed(maker, no_echoes(0.2), scan(0.2, FAR))
    assert sensed is not None
    assert len(maker.trajectory) == 2  # for the pose all scans count
    # one without is left out, for it may be that a line was lost
    assert feed(maker, scan(0.3, 3.0)) == [None]
    assert feed(maker, echoes(0.4, (2.0, "hit"), lines=2), scan(0.4, 2.0))[1] is None
    assert maker.scans == 1
    # but not for ever
    assert feed(maker, scan(0.71, 3.0))[0] is not None


def test_ranges_are_mapped_when_no_echoes_arrive_in_time() -> None:
    maker = mapper(echo_wait=1.0)
    taken = [feed(maker, ins(t), scan(t, 3.0))[1] for t in (0.0, 0.5, 0.95, 1.0, 1.1)]
    assert [sensed is not None for sensed in taken] == [False, False, False, True, True]


def test_echoes_of_another_time_or_scanner_are_not_used() -> None:
    maker = mapper(echo_wait=9.0)
    feed(maker, ins(0.1), echoes(0.1, (2.0, "hit")))
    assert feed(maker, scan(0.2, 2.0)) == [None]
    other = echoes(0.3, (2.0, "hit"), scanner="another")
    assert feed(maker, other, scan(0.3, 2.0)) == [None, None]


def test_echo_lines_may_arrive_in_any_order_and_twice() -> None:
    maker = mapper()
    one = echoes(0.1, (2.0, "hit"), line=1, lines=2)
    two = echoes(0.1, (2.0, "rain"), name="air", line=2, lines=2)
    assert feed(maker, ins(0.1), two, one, two, scan(0.1, 2.0))[-1] is not None


def test_other_scanners_and_reports_change_nothing() -> None:
    maker = mapper(echo_wait=0.0)
    feed(maker, ins(0.1), scan(0.1, 3.0, "hokuyo"), Status(0.1, 99, False))
    assert maker.scans == len(maker.trajectory) == 0


@pytest.mark.parametrize(
    ("source", "useless", "useful"),
    [
        pytest.param("ins", Odometry(0.0, "O", Pose2(0, 0)), ins(0.1), id="ins"),
        pytest.param("odometry", ins(0.0), Odometry(0.1, "O", Pose2(0, 0)), id="odo"),
    ],
)
def test_scans_without_the_motion_source_are_not_mapped(
    source: str, useless: Report, useful: Report
) -> None:
    maker = mapper(motion_source=source, echo_wait=0.0)
    assert maker.missing == f"pose from {source}"
    feed(maker, useless, scan(0.0, 3.0))
    assert maker.scans == 0
    feed(maker, useful, scan(0.1, 3.0))
    assert maker.scans == 1


@pytest.mark.parametrize("source", ["odometry", "none"])
def test_map_starts_at_the_spawn_pose_for_every_motion_source(source: str) -> None:
    maker = mapper(motion_source=source, echo_wait=0.0)
    feed(maker, truth(0.0, 4.0), Odometry(0.0, "O", Pose2(0, 0)), scan(0.0, 3.0))
    assert maker.trajectory.poses == [Pose2(4.0, 0.0)]


def test_map_starts_at_the_origin_without_poses() -> None:
    maker = mapper(motion_source="none", echo_wait=0.0)
    feed(maker, scan(0.0, 3.0))
    assert maker.trajectory.poses == [Pose2(0.0, 0.0)]


def test_true_poses_are_stored_at_a_limited_rate() -> None:
    maker = mapper()
    feed(maker, *(truth(0.01 * k, 0.1 * k) for k in range(101)))
    assert maker.truth.times == pytest.approx([0.05 * k for k in range(21)])
    assert maker.truth.poses[-1].x == pytest.approx(10.0)


def test_scans_without_time_and_limits_are_mapped() -> None:
    facts = ScannerInfo("lms200", Pose3(0, 0, 0), 0.0, math.inf, 0.1, FOV, BEAMS)
    maker = Mapper(facts, echo_wait=0.0)
    feed(maker, ins(math.nan), scan(math.nan, 3.0))
    assert class_at(maker, 3.0, 0.0) == CellClass.OBSTACLE
    feed(maker, ins(math.nan), scan(math.nan, 1e9))  # nothing is that far away
    assert max(maker.grid.frame.shape) < 9000


def test_floor_under_the_robot_is_free() -> None:
    maker = mapper(echo_wait=0.0, robot_radius=0.25)
    feed(maker, ins(0.0), scan(0.0, 3.0))
    assert class_at(maker, 0.0, 0.2) == class_at(maker, -0.2, 0.0) == CellClass.FREE
    assert class_at(maker, 0.0, 0.35) == CellClass.UNKNOWN


def drive() -> Iterator[Report]:
    """Return the reports of a robot that circles in a room."""
    for k in range(400):
        t = 0.1 * k
        pose = Pose2(0.5 * math.cos(t / 5), 1 + 0.5 * math.sin(t / 5), t / 5)
        yield GroundTruth(t, "G", Pose3(pose.x, pose.y, 0.0, yaw=pose.yaw))
        yield ins(t, pose.x, pose.y, pose.yaw)
        seen = look(ROOM, pose)
        fov = float(seen.angles[-1] - seen.angles[0])
        yield RangeScan(t, "lms200", math.radians(1), fov, seen.known_range)


def test_map_does_not_grow_while_the_robot_circles_in_a_room() -> None:
    """The grid and the point map grow with the room, not with time."""
    facts = ScannerInfo("lms200", Pose3(0, 0, 0), 0.0, 30.0, 0.1, 6.0, 360)
    maker = Mapper(facts, echo_wait=0.0)
    sizes = []
    for report in drive():
        maker.take(report)
        sizes.append((maker.grid.frame.shape, len(maker.slam.map.points)))
    grids, points = zip(*sizes, strict=True)
    assert grids[100] == grids[-1]
    assert points[-1] < 1.15 * points[len(points) // 2]
    assert maker.scans == len(maker.trajectory) == len(maker.truth) == 400


def test_missing_names_the_motion_source_when_it_stops() -> None:
    maker = mapper(echo_wait=0.0)
    feed(maker, ins(0.0))
    seen = feed(
        maker, *[scan(0.1 * k, 5.0) for k in range(MAX_SCANS_WITHOUT_MOTION + 3)]
    )
    assert [one is not None for one in seen] == [True] * MAX_SCANS_WITHOUT_MOTION + [
        False
    ] * 3
    assert maker.missing == "pose from ins"
    feed(maker, ins(9.0))
    assert maker.take(scan(9.0, 5.0)) is not None


def test_echoes_belong_to_scans_without_time_stamps_too() -> None:
    maker = mapper()
    for k in range(3):
        near = 2.0 + 0.1 * k
        feed(maker, ins(math.nan), echoes(math.nan, (near, "enter"), (4.0, "spent")))
        feed(maker, scan(math.nan, 4.0))
    assert maker.scans == 3
    assert class_at(maker, 0.2 + 3.0, 0.0) == CellClass.FOLIAGE


def test_only_what_is_within_the_map_range_is_mapped() -> None:
    maker = mapper(map_range=2.5)
    *_, sensed = feed(
        maker,
        ins(0.1),
        echoes(0.1, (1.0, "enter"), (3.0, "leave"), line=1, lines=2),
        echoes(0.1, (5.0, "hit"), name="wall", material="brick", line=2, lines=2),
        scan(0.1, 5.0),
    )
    assert sensed.ranges[AHEAD] == pytest.approx(1.2)
    assert class_at(maker, 1.9, 0.0) == CellClass.FOLIAGE
    assert class_at(maker, 2.6, 0.0) == CellClass.FOLIAGE
    across, up = np.meshgrid(*maker.grid.frame.cell_centers())
    away = np.hypot(across - 0.2, up)[maker.grid.sensed_cells()]
    assert 2.4 < away.max() < 2.6


def test_scans_that_are_left_out_are_counted() -> None:
    maker = mapper(echo_wait=0.5)
    feed(maker, scan(0.0, 3.0), ins(0.1), scan(0.1, 3.0), scan(0.2, 3.0))
    feed(maker, no_echoes(0.3), scan(0.3, 3.0))
    assert (maker.scans, maker.left_out) == (1, {"no_pose": 1, "no_echoes": 2})
