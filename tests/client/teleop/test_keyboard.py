import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.client.teleop.teleop import (
    FIRST_HOLD,
    REPEAT_HOLD,
    SPEED_STEP,
    Key,
    Steering,
)

TURN = 0.3 * 0.4 / 0.2  # rad/s on the spot at 0.4 m/s, wheels 0.4 m apart
SLOWEST_REPEAT = 0.66  # s before a held key repeats, on the slowest usual terminal


def steering(speed: float = 0.4) -> Steering:
    return Steering(speed, top_speed=0.8, wheel_separation=0.4)


def test_steering_starts_at_rest() -> None:
    assert steering().motion(0.0) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("key", "motion"),
    [
        (Key.AHEAD, (0.4, 0.0)),
        (Key.BACK, (-0.4, 0.0)),
        (Key.LEFT, (0.0, TURN)),
        (Key.RIGHT, (0.0, -TURN)),
    ],
)
def test_key_press_moves_for_a_limited_time(
    key: Key, motion: tuple[float, float]
) -> None:
    driver = steering()
    driver.press(key, 1.0)
    assert driver.motion(1.0) == pytest.approx(motion)
    assert driver.motion(1.0 + FIRST_HOLD - 0.01) == pytest.approx(motion)
    assert driver.motion(1.0 + FIRST_HOLD) == (0.0, 0.0)


def test_held_key_moves_continuously_and_stops_soon_after_release() -> None:
    driver = steering()
    presses = [0.0, *(SLOWEST_REPEAT + 0.09 * i for i in range(20))]
    for i, now in enumerate(presses):
        if i:
            assert driver.motion(now - 1e-6) == (0.4, 0.0)
        driver.press(Key.AHEAD, now)
    assert driver.motion(presses[-1] + REPEAT_HOLD - 0.01) == (0.4, 0.0)
    assert driver.motion(presses[-1] + REPEAT_HOLD) == (0.0, 0.0)


def test_space_stops_immediately() -> None:
    driver = steering()
    driver.press(Key.AHEAD, 0.0)
    driver.press(Key.LEFT, 0.1)
    driver.press(Key.STOP, 0.2)
    assert driver.motion(0.2) == (0.0, 0.0)
    driver.press(Key.LEFT, 0.3)
    assert driver.motion(0.3) == pytest.approx((0.0, TURN)), "ahead is forgotten too"


def test_turn_key_prolongs_motion_ahead() -> None:
    driver = steering()
    driver.press(Key.AHEAD, 0.0)
    driver.press(Key.LEFT, 0.5)
    assert driver.motion(0.5 + FIRST_HOLD - 0.01) == pytest.approx((0.4, TURN))
    assert driver.motion(0.5 + FIRST_HOLD) == (0.0, 0.0)


def test_ahead_key_does_not_prolong_a_turn() -> None:
    driver = steering()
    driver.press(Key.LEFT, 0.0)
    driver.press(Key.AHEAD, 0.5)
    assert driver.motion(0.6) == pytest.approx((0.4, TURN))
    assert driver.motion(FIRST_HOLD) == (0.4, 0.0)


def test_turn_from_rest_is_on_the_spot() -> None:
    driver = steering()
    driver.press(Key.AHEAD, 0.0)
    driver.press(Key.LEFT, 5.0)
    assert driver.motion(5.0) == pytest.approx((0.0, TURN))


def test_opposite_key_reverses_the_motion() -> None:
    driver = steering()
    driver.press(Key.AHEAD, 0.0)
    driver.press(Key.BACK, 0.1)
    assert driver.motion(0.1) == (-0.4, 0.0)


def test_speed_keys_change_the_speed_of_a_moving_robot_only() -> None:
    driver = steering()
    driver.press(Key.FASTER, 0.0)
    assert driver.motion(0.0) == (0.0, 0.0)
    driver.press(Key.AHEAD, 0.1)
    driver.press(Key.SLOWER, 0.2)
    driver.press(Key.SLOWER, 0.3)
    assert driver.motion(0.3) == pytest.approx((0.35, 0.0))
    assert driver.motion(0.1 + FIRST_HOLD) == (0.0, 0.0), "these keys hold nothing"


@pytest.mark.parametrize(("speed", "slowest"), [(0.4, SPEED_STEP), (0.02, 0.02)])
def test_speed_is_limited(speed: float, slowest: float) -> None:
    driver = steering(speed)
    for _ in range(30):
        driver.press(Key.SLOWER, 0.0)
    assert driver.speed == pytest.approx(slowest)
    for _ in range(30):
        driver.press(Key.FASTER, 0.0)
    assert driver.speed == 0.8


def test_initial_speed_is_limited_to_the_top_speed() -> None:
    assert steering(3.0).speed == 0.8


@given(st.lists(st.tuples(st.sampled_from(Key), st.floats(0.0, 2.0)), max_size=30))
def test_robot_stops_without_keys_after_any_key_sequence(
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
