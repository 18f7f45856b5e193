import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.geometry import Pose2, Pose3, rotation_matrix, wrap_angle

angles = st.floats(-10, 10)
lengths = st.floats(-100, 100)
poses = st.builds(Pose3, lengths, lengths, lengths, angles, angles, angles)
places = st.builds(Pose2, lengths, lengths, angles)


@given(angle=st.floats(-1e3, 1e3))
def test_wrapped_angle_is_in_range_and_has_the_same_direction(angle: float) -> None:
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


def test_yaw_rotates_forward_to_the_left_and_pitch_rotates_it_down() -> None:
    ahead = np.array([1.0, 0.0, 0.0])
    assert rotation_matrix(0, 0, math.pi / 2) @ ahead == pytest.approx([0, 1, 0])
    assert rotation_matrix(0, math.pi / 2, 0) @ ahead == pytest.approx([0, 0, -1])
    left = np.array([0.0, 1.0, 0.0])
    assert rotation_matrix(math.pi / 2, 0, 0) @ left == pytest.approx([0, 0, 1])


@given(outer=poses, inner=poses, point=st.tuples(lengths, lengths, lengths))
def test_composed_pose_transforms_points_like_both_in_turn(
    outer: Pose3, inner: Pose3, point: tuple[float, float, float]
) -> None:
    both = outer.compose(inner)
    once = inner.position() + inner.rotation() @ np.array(point)
    twice = outer.position() + outer.rotation() @ once
    moved = both.position() + both.rotation() @ np.array(point)
    assert moved == pytest.approx(twice, abs=1e-6)


@given(places, lengths, lengths, lengths)
def test_unturned_pose_is_composed_as_by_matrices_exactly(
    place: Pose2, height: float, ahead: float, above: float
) -> None:
    outer = Pose3(place.x, place.y, height, yaw=place.yaw)
    inner = Pose3(ahead, 0.0, above)
    both, turn = outer.compose(inner), outer.rotation()
    moved = outer.position() + turn @ inner.position()
    assert both.position().tolist() == moved.tolist()
    yaw = math.atan2(turn[1, 0], turn[0, 0])
    assert (both.roll, both.pitch, both.yaw) == (0.0, 0.0, yaw)


@given(outer=places, inner=places)
def test_poses_on_the_floor_compose_like_those_in_space(
    outer: Pose2, inner: Pose2
) -> None:
    both = outer.compose(inner)
    space = [Pose3(pose.x, pose.y, 0.0, yaw=pose.yaw) for pose in (outer, inner)]
    same = space[0].compose(space[1])
    assert (both.x, both.y) == pytest.approx((same.x, same.y), abs=1e-9)
    assert wrap_angle(both.yaw - same.yaw) == pytest.approx(0, abs=1e-9)


@given(one=places, other=places)
def test_relative_pose_composes_to_the_original(one: Pose2, other: Pose2) -> None:
    again = other.compose(one.relative_to(other))
    assert (again.x, again.y) == pytest.approx((one.x, one.y), abs=1e-9)
    assert wrap_angle(again.yaw - one.yaw) == pytest.approx(0, abs=1e-9)


def test_composing_at_the_pole_preserves_the_matrix() -> None:
    pose = Pose3(0, 0, 0, 0.3, -math.pi / 2, 0.7)
    again = Pose3(0, 0, 0).compose(pose)
    assert again.rotation() == pytest.approx(pose.rotation(), abs=1e-9)


def test_level_pose_has_no_negative_zeros() -> None:
    numbers = Pose3(1, 2, 3).compose(Pose3(0.5, 0, 0)).numbers()
    assert [math.copysign(1, number) for number in numbers] == [1.0] * 6


@pytest.mark.parametrize(
    "numbers", [[1, 2, 3], [1, 2, 3, 4, 5, math.nan], [1, 2, 3, 4, 5, math.inf]]
)
def test_pose_is_six_finite_numbers(numbers: list[float]) -> None:
    with pytest.raises(ValueError, match="expected six finite numbers"):
        Pose3.from_numbers(numbers)


def test_place_of_a_pose_of_integers_is_of_floats() -> None:
    assert Pose3(1, 2, 3).position().dtype == np.float64
