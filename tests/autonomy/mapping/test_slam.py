"""SLAM in a flat world whose true poses are known."""

import math
from collections.abc import Iterator

import numpy as np
import pytest
from flat_world import NOWHERE, ROOM, errors_of, look
from hypothesis import given, settings
from hypothesis import strategies as st

from radarsim.autonomy.mapping.loop_closure import KeyframeMap
from radarsim.autonomy.mapping.scan import PlanarScan
from radarsim.autonomy.mapping.slam import Slam
from radarsim.autonomy.plans import MotionSource
from radarsim.geometry import Pose2
from radarsim.rng import generator_for

START = Pose2(-4.0, 0.5, 0.3)
STEP = 0.08  # m between two scans


def drive() -> Iterator[Pose2]:
    """Go once around the boxes, turning on the spot, and stand still at first."""
    x, y, yaw = START.x, START.y, START.yaw
    for _ in range(3):
        yield Pose2(x, y, yaw)
    for goal_x, goal_y in [(0, 3), (4, 2.5), (4.5, -2.5), (0, -2), (-4.5, 0), (-4, 1)]:
        while math.hypot(goal_x - x, goal_y - y) > STEP:
            bearing = math.atan2(goal_y - y, goal_x - x)
            turn = math.remainder(bearing - yaw, 2 * math.pi)
            yaw += max(-0.12, min(turn, 0.12))
            if abs(turn) < 0.2:
                x, y = x + STEP * math.cos(yaw), y + STEP * math.sin(yaw)
            yield Pose2(x, y, yaw)


def drifting(path: list[Pose2], share: float) -> list[Pose2]:
    """Return a path with INS errors proportional to distance and turn."""
    rng = generator_for(5, "drift")
    rows = np.array([[pose.x, pose.y, pose.yaw] for pose in path])
    steps = np.diff(rows, axis=0)
    steps[:, 2] = np.arctan2(np.sin(steps[:, 2]), np.cos(steps[:, 2]))
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    size = np.column_stack([lengths, lengths, np.abs(steps[:, 2])])
    steps += share * size * rng.standard_normal(steps.shape)
    return [
        Pose2(*row) for row in np.vstack([rows[:1], rows[0] + steps.cumsum(axis=0)])
    ]


PATH = list(drive())


@pytest.fixture(scope="module")
def scans() -> list[PlanarScan]:
    return [look(ROOM, pose, time=0.1 * i) for i, pose in enumerate(PATH)]


def matched(
    scans: list[PlanarScan], seeds: list[Pose2 | None], kind: MotionSource
) -> Slam:
    slam = Slam(kind, START)
    for scan, seed in zip(scans, seeds, strict=True):
        slam.step(scan, seed)
    return slam


def test_matching_removes_most_of_the_drift(scans: list[PlanarScan]) -> None:
    ins = drifting(PATH, 0.15)
    drift = errors_of(ins, PATH)
    slam = matched(scans, [*ins], "ins")
    found = errors_of(slam.trajectory.poses, PATH)
    assert drift["ate"] > 0.1
    assert drift["yaw"] > 0.04
    assert found["ate_max"] < 0.03
    assert found["yaw_max"] < math.radians(0.5)
    assert slam.trajectory.times == pytest.approx([0.1 * i for i in range(len(PATH))])


def test_odometry_may_have_any_origin(scans: list[PlanarScan]) -> None:
    """Its origin and axes are those of the pose where it was switched on."""
    slam = matched(scans, [pose.relative_to(START) for pose in PATH], "odometry")
    assert errors_of(slam.trajectory.poses, PATH)["ate_max"] < 0.03


def test_scans_suffice_without_a_motion_source(scans: list[PlanarScan]) -> None:
    slam = matched(scans[:120], [None] * 120, "none")
    found = errors_of(slam.trajectory.poses, PATH[:120])
    assert found["ate_max"] < 0.05
    assert found["yaw_max"] < math.radians(0.5)


def test_missing_priors_are_tolerated(scans: list[PlanarScan]) -> None:
    seeds = [pose if i % 7 else None for i, pose in enumerate(PATH)]
    slam = matched(scans, seeds, "ins")
    assert errors_of(slam.trajectory.poses, PATH)["ate_max"] < 0.05


def test_spinning_wheels_do_not_move_a_robot_that_sees_walls() -> None:
    scan = look(ROOM, START)
    slam = Slam("odometry", START)
    for i in range(100):
        slam.step(scan, Pose2(STEP * i, 0.0, 0.0))
    assert math.hypot(slam.pose.x - START.x, slam.pose.y - START.y) < 0.05


places = st.builds(Pose2, st.floats(-50, 50), st.floats(-50, 50), st.floats(-3.1, 3.1))


@settings(max_examples=25)
@given(seeds=st.lists(places, min_size=1, max_size=20))
def test_without_points_ins_motion_is_applied_on_the_axes_of_the_map(
    seeds: list[Pose2],
) -> None:
    slam = Slam("ins", START)
    scan = look(NOWHERE, START)
    for seed in seeds:
        pose = slam.step(scan, seed)
        assert pose.x == pytest.approx(START.x + seed.x - seeds[0].x)
        assert pose.y == pytest.approx(START.y + seed.y - seeds[0].y)
        turn = pose.yaw - START.yaw - (seed.yaw - seeds[0].yaw)
        assert math.remainder(turn, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


@settings(max_examples=25)
@given(seeds=st.lists(places, min_size=1, max_size=20))
def test_without_points_odometry_is_applied_on_the_axes_of_the_robot(
    seeds: list[Pose2],
) -> None:
    slam = Slam("odometry", START)
    scan = look(NOWHERE, START)
    turn = START.yaw - seeds[0].yaw
    c, s = math.cos(turn), math.sin(turn)
    for seed in seeds:
        pose = slam.step(scan, seed)
        dx, dy = seed.x - seeds[0].x, seed.y - seeds[0].y
        assert pose.x == pytest.approx(START.x + c * dx - s * dy, abs=1e-6)
        assert pose.y == pytest.approx(START.y + s * dx + c * dy, abs=1e-6)


def test_pose_stays_without_points_and_motion_source() -> None:
    slam = Slam("none", START)
    for _ in range(5):
        assert slam.step(look(NOWHERE, START)) == START


def test_first_prior_is_the_start_by_default() -> None:
    assert Slam().step(look(ROOM, START), START) == START
    assert Slam().step(look(ROOM, START)) == Pose2(0.0, 0.0)


@pytest.mark.parametrize("kind", ["ins", "odometry"])
def test_dead_reckoning_follows_the_motion_source_whatever_the_scans_say(
    scans: list[PlanarScan], kind: MotionSource
) -> None:
    seeds = drifting(PATH, 0.15)
    if kind == "odometry":
        seeds = [pose.relative_to(seeds[0]) for pose in seeds]
    slam = matched(scans, [*seeds], kind)
    expected = [START.compose(pose.relative_to(seeds[0])) for pose in seeds]
    found = slam.dead_reckoning
    assert found.times == slam.trajectory.times
    for pose, other in zip(found.poses, expected, strict=True):
        assert (pose.x, pose.y) == pytest.approx((other.x, other.y), abs=1e-6)


def test_without_a_motion_source_there_is_no_dead_reckoning(
    scans: list[PlanarScan],
) -> None:
    assert len(matched(scans[:3], [None] * 3, "none").dead_reckoning) == 0


@pytest.mark.parametrize(
    ("turn", "expected"),
    [
        pytest.param(0.001, (1, 0), id="as true as the first scans"),
        pytest.param(-0.003, (4, 4), id="turned"),
        pytest.param(None, (4, 0), id="not shown by the first scans"),
    ],
)
def test_map_is_turned_back_to_its_start_a_few_times(
    monkeypatch: pytest.MonkeyPatch,
    turn: float | None,
    expected: tuple[int, int],
) -> None:
    seen, (looks, moves) = [], expected

    def find_correction(known: KeyframeMap, _: int) -> Pose2 | None:
        seen.append(known.keyframes[-1].station)
        return None if turn is None else Pose2(0.0, 0.0, turn)

    monkeypatch.setattr(
        "radarsim.autonomy.mapping.slam.find_correction", find_correction
    )
    monkeypatch.setattr("radarsim.autonomy.mapping.slam.ANCHOR_INTERVAL", 4.0)
    slam = Slam("odometry")
    for pose in PATH:
        slam.step(look(ROOM, pose), pose)
    assert len(seen) == looks
    assert seen == pytest.approx([4.0 * (k + 1) for k in range(looks)], abs=0.6)
    assert slam.revision == moves
