import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.geometry import Pose3, rotation_matrix
from radarsim.protocol.message import (
    angles_on_wire,
    flip_axes,
    pose_from_wire,
    position_on_wire,
)

ANGLES = st.floats(-3, 3)


def test_left_becomes_negative_and_up_becomes_negative() -> None:
    pose = Pose3(1.0, 2.0, 3.0, 0.1, 0.2, 0.3)
    assert position_on_wire(pose) == (1.0, -2.0, -3.0)
    assert angles_on_wire(pose) == (0.1, -0.2, -0.3)


@given(numbers=st.tuples(*[st.floats(-1e3, 1e3)] * 6))
def test_a_pose_comes_back_from_the_wire(numbers: tuple[float, ...]) -> None:
    pose = pose_from_wire(numbers)
    assert (*position_on_wire(pose), *angles_on_wire(pose)) == numbers


def test_zero_has_no_sign_on_the_wire() -> None:
    for number in flip_axes((0.0, 0.0, 0.0)):
        assert math.copysign(1, number) == 1


@given(roll=ANGLES, pitch=ANGLES, yaw=ANGLES)
def test_angles_turn_as_the_axes_do(roll: float, pitch: float, yaw: float) -> None:
    half_turn = np.diag([1.0, -1.0, -1.0])
    inside = rotation_matrix(roll, pitch, yaw)
    outside = rotation_matrix(*flip_axes((roll, pitch, yaw)))
    assert outside == pytest.approx(half_turn @ inside @ half_turn)
