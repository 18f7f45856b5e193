import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.client.teleop import (
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


REST = (0.0, 0.0)
BOTH = (0.4, TURN)
JUST_HELD = FIRST_HOLD - 0.01
STEPS: dict[str, list[tuple[float, Key | tuple[float, float]]]] = {
    "nothing is pressed": [(0.0, REST)],
    **{
        f"{key}, for a limited time": [
            *((1.0, key), (1.0, motion)),
            *((1.0 + JUST_HELD, motion), (1.0 + FIRST_HOLD, REST)),
        ]
        for key, motion in {
            Key.AHEAD: (0.4, 0.0),
            Key.BACK: (-0.4, 0.0),
            Key.LEFT: (0.0, TURN),
            Key.RIGHT: (0.0, -TURN),
        }.items()
    },
    "space stops, and forgets what was before": [
        *((0.0, Key.AHEAD), (0.1, Key.LEFT), (0.2, Key.STOP), (0.2, REST)),
        *((0.3, Key.LEFT), (0.3, (0.0, TURN))),
    ],
    "a turn prolongs motion ahead": [
        *((0.0, Key.AHEAD), (0.5, Key.LEFT)),
        *((0.5 + JUST_HELD, BOTH), (0.5 + FIRST_HOLD, REST)),
    ],
    "motion ahead prolongs no turn": [
        *((0.0, Key.LEFT), (0.5, Key.AHEAD)),
        *((0.6, BOTH), (FIRST_HOLD, (0.4, 0.0))),
    ],
    "a turn from rest is on the spot": [
        *((0.0, Key.AHEAD), (5.0, Key.LEFT), (5.0, (0.0, TURN))),
    ],
    "an opposite key reverses": [
        *((0.0, Key.AHEAD), (0.1, Key.BACK), (0.1, (-0.4, 0.0))),
    ],
    "keys of speed hold nothing": [
        *((0.0, Key.FASTER), (0.0, REST), (0.1, Key.AHEAD)),
        *((0.2, Key.SLOWER), (0.3, Key.SLOWER)),
        *((0.3, (0.35, 0.0)), (0.1 + FIRST_HOLD, REST)),
    ],
}


@pytest.mark.parametrize("steps", STEPS.values(), ids=STEPS)
def test_keys_move_the_robot(
    steps: list[tuple[float, Key | tuple[float, float]]],
) -> None:
    driver = steering()
    for now, step in steps:
        if isinstance(step, Key):
            driver.press(step, now)
        else:
            assert driver.motion(now) == pytest.approx(step)


def test_held_key_moves_continuously_and_stops_soon_after_release() -> None:
    driver = steering()
    presses = [0.0, *(SLOWEST_REPEAT + 0.09 * i for i in range(20))]
    for i, now in enumerate(presses):
        if i:
            assert driver.motion(now - 1e-6) == (0.4, 0.0)
        driver.press(Key.AHEAD, now)
    assert driver.motion(presses[-1] + REPEAT_HOLD - 0.01) == (0.4, 0.0)
    assert driver.motion(presses[-1] + REPEAT_HOLD) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("speed", "slowest"), [(3.0, SPEED_STEP), (0.4, SPEED_STEP), (0.02, 0.02)]
)
def test_speed_is_limited(speed: float, slowest: float) -> None:
    driver = steering(speed)
    assert driver.speed == min(speed, 0.8)
    for _ in range(30):
        driver.press(Key.SLOWER, 0.0)
    assert driver.speed == pytest.approx(slowest)
    for _ in range(30):
        driver.press(Key.FASTER, 0.0)
    assert driver.speed == 0.8


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
