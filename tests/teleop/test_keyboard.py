import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.teleop.keyboard import FIRST_HOLD, REPEAT_HOLD, SPEED_STEP, Key, Steering

TURN = 0.3 * 0.4 / 0.2  # rad/s on the spot at 0.4 m/s, wheels 0.4 m apart
SLOWEST_REPEAT = 0.66  # s before a held key repeats, on the slowest usual terminal


def steering(speed: float = 0.4) -> Steering:
    return Steering(speed, top_speed=0.8, wheel_separation=0.4)


def test_it_begins_at_rest() -> None:
    assert steering().motion(0.0) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("key", "motion"),
    [
        pytest.param(Key.AHEAD, (0.4, 0.0), id="ahead"),
        pytest.param(Key.BACK, (-0.4, 0.0), id="back"),
        pytest.param(Key.LEFT, (0.0, TURN), id="left is counter-clockwise"),
        pytest.param(Key.RIGHT, (0.0, -TURN), id="right"),
    ],
)
def test_a_press_moves_for_a_while(key: Key, motion: tuple[float, float]) -> None:
    driver = steering()
    driver.press(key, 1.0)
    assert driver.motion(1.0) == pytest.approx(motion)
    assert driver.motion(1.0 + FIRST_HOLD - 0.01) == pytest.approx(motion)
    assert driver.motion(1.0 + FIRST_HOLD) == (0.0, 0.0)


def test_a_held_key_moves_without_a_break_and_stops_soon_after_it_is_let_go() -> None:
    driver = steering()
    presses = [0.0, *(SLOWEST_REPEAT + 0.09 * i for i in range(20))]
    for i, now in enumerate(presses):
        if i:
            assert driver.motion(now - 1e-6) == (0.4, 0.0)
        driver.press(Key.AHEAD, now)
    assert driver.motion(presses[-1] + REPEAT_HOLD - 0.01) == (0.4, 0.0)
    assert driver.motion(presses[-1] + REPEAT_HOLD) == (0.0, 0.0)


def test_space_stops_at_once() -> None:
    driver = steering()
    driver.press(Key.AHEAD, 0.0)
    driver.press(Key.LEFT, 0.1)
    driver.press(Key.STOP, 0.2)
    assert driver.motion(0.2) == (0.0, 0.0)
    driver.press(Key.LEFT, 0.3)
    assert driver.motion(0.3) == pytest.approx((0.0, TURN)), "ahead is forgotten too"


def test_turning_on_the_way_keeps_the_robot_going() -> None:
    driver = steering()
    driver.press(Key.AHEAD, 0.0)
    driver.press(Key.LEFT, 0.5)
    assert driver.motion(0.5 + FIRST_HOLD - 0.01) == pytest.approx((0.4, TURN))
    assert driver.motion(0.5 + FIRST_HOLD) == (0.0, 0.0)


def test_going_ahead_does_not_keep_the_robot_turning() -> None:
    driver = steering()
    driver.press(Key.LEFT, 0.0)
    driver.press(Key.AHEAD, 0.5)
    assert driver.motion(0.6) == pytest.approx((0.4, TURN))
    assert driver.motion(FIRST_HOLD) == (0.4, 0.0)


def test_turning_from_rest_is_on_the_spot() -> None:
    driver = steering()
    driver.press(Key.AHEAD, 0.0)
    driver.press(Key.LEFT, 5.0)
    assert driver.motion(5.0) == pytest.approx((0.0, TURN))


def test_the_opposite_key_turns_the_motion_round() -> None:
    driver = steering()
    driver.press(Key.AHEAD, 0.0)
    driver.press(Key.BACK, 0.1)
    assert driver.motion(0.1) == (-0.4, 0.0)


def test_the_speed_changes_while_the_robot_moves_and_moves_none_that_stands() -> None:
    driver = steering()
    driver.press(Key.FASTER, 0.0)
    assert driver.motion(0.0) == (0.0, 0.0)
    driver.press(Key.AHEAD, 0.1)
    driver.press(Key.SLOWER, 0.2)
    driver.press(Key.SLOWER, 0.3)
    assert driver.motion(0.3) == pytest.approx((0.35, 0.0))
    assert driver.motion(0.1 + FIRST_HOLD) == (0.0, 0.0), "these keys hold nothing"


@pytest.mark.parametrize(
    ("speed", "slowest"),
    [
        pytest.param(0.4, SPEED_STEP, id="usual"),
        pytest.param(0.02, 0.02, id="slower than a step"),
    ],
)
def test_the_speed_has_limits(speed: float, slowest: float) -> None:
    driver = steering(speed)
    for _ in range(30):
        driver.press(Key.SLOWER, 0.0)
    assert driver.speed == pytest.approx(slowest)
    for _ in range(30):
        driver.press(Key.FASTER, 0.0)
    assert driver.speed == 0.8


def test_nobody_begins_faster_than_the_robot_can_be() -> None:
    assert steering(3.0).speed == 0.8


@given(st.lists(st.tuples(st.sampled_from(Key), st.floats(0.0, 2.0)), max_size=30))
def test_whatever_is_pressed_the_robot_stops_when_no_key_comes(
    presses: list[tuple[Key, float]],
) -> None:
    driver = steering()
    now = 0.0
    for key, gap in presses:
        now += gap
        driver.press(key, now)
        speed, turn = driver.motion(now)
        assert abs(speed) <= 0.8
        assert math.isfinite(turn)
    assert driver.motion(now + FIRST_HOLD) == (0.0, 0.0)
