import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.geometry import Pose2, wrap_angle
from radarsim.protocol.dialect import DriveUnit, WheelDrive
from radarsim.robots import motion as skid_steer

speeds = st.floats(-1, 1)
poses = st.builds(Pose2, st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3))


def advance(
    pose: Pose2, left: float, right: float, *, track: float, dt: float
) -> Pose2:
    start = (float(pose.x), float(pose.y), float(pose.yaw))
    speeds = (float(left), float(right), track, 0.0, float(dt))
    return Pose2(*skid_steer.advance(start, *speeds))


def same(one: Pose2, other: Pose2) -> bool:
    apart = math.hypot(one.x - other.x, one.y - other.y)
    return apart < 1e-9 and abs(wrap_angle(one.yaw - other.yaw)) < 1e-9


@given(pose=poses, left=speeds, right=speeds, dt=st.floats(0, 5))
def test_two_half_steps_equal_one_whole_step(
    pose: Pose2, left: float, right: float, dt: float
) -> None:
    half = advance(pose, left, right, track=0.36, dt=dt / 2)
    twice = advance(half, left, right, track=0.36, dt=dt / 2)
    assert same(twice, advance(pose, left, right, track=0.36, dt=dt))


@given(pose=poses, left=speeds, right=speeds)
def test_driving_backward_undoes_driving_forward(
    pose: Pose2, left: float, right: float
) -> None:
    there = advance(pose, left, right, track=0.36, dt=1)
    assert same(advance(there, -left, -right, track=0.36, dt=1), pose)


@given(pose=poses, left=speeds, right=speeds)
def test_step_starts_along_the_heading(pose: Pose2, left: float, right: float) -> None:
    step = advance(pose, left, right, track=0.36, dt=1e-6)
    speed = (left + right) / 2 * 1e-6
    assert step.x - pose.x == pytest.approx(speed * math.cos(pose.yaw), abs=1e-11)
    assert step.y - pose.y == pytest.approx(speed * math.sin(pose.yaw), abs=1e-11)


@pytest.mark.parametrize(
    ("left", "right", "end"),
    [
        pytest.param(0.5, 0.5, Pose2(1, 0, 0), id="straight ahead"),
        pytest.param(-0.5, -0.5, Pose2(-1, 0, 0), id="straight back"),
        pytest.param(0, 0.36 * math.pi / 4, Pose2(0.18, 0.18, math.pi / 2), id="left"),
        pytest.param(
            0.36 * math.pi / 4, 0, Pose2(0.18, -0.18, -math.pi / 2), id="right"
        ),
        pytest.param(
            -0.18 * math.pi / 2, 0.18 * math.pi / 2, Pose2(0, 0, math.pi), id="spin"
        ),
    ],
)
def test_known_arcs(left: float, right: float, end: Pose2) -> None:
    assert same(advance(Pose2(0, 0), left, right, track=0.36, dt=2), end)


def test_wider_track_turns_less() -> None:
    narrow = advance(Pose2(0, 0), -0.1, 0.1, track=0.36, dt=1)
    wide = advance(Pose2(0, 0), -0.1, 0.1, track=0.72, dt=1)
    assert wide.yaw == pytest.approx(narrow.yaw / 2)


@pytest.mark.parametrize(
    ("unit", "limit", "value", "normalized", "spin"),
    [
        pytest.param("rad_per_s", 8.17, 2.5, False, 2.5, id="as it is"),
        pytest.param("rad_per_s", 8.17, -9, False, -8.17, id="clamped"),
        pytest.param("rad_per_s", 8.17, 50, True, 4.085, id="percent"),
        pytest.param("rad_per_s", 8.17, -250, True, -8.17, id="percent clamped"),
        pytest.param("rev_per_s", 1.3, 1, False, 2 * math.pi, id="turns"),
        pytest.param("rev_per_s", 1.3, 5, False, 2.6 * math.pi, id="turns clamped"),
        pytest.param("rev_per_s", 1.3, 100, True, 2.6 * math.pi, id="turns percent"),
    ],
)
def test_conversion_of_commanded_speeds(
    unit: DriveUnit, limit: float, value: float, normalized: bool, spin: float
) -> None:
    drive = WheelDrive(limit, unit)
    assert drive.spin(value, normalized=normalized) == pytest.approx(spin)
