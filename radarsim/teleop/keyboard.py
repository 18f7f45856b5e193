"""Convert key presses to motion.

Theory of operation
===================
Terminals report keys that are pressed, never keys that are released; a key that is held
repeats, after a pause of up to 0.66 s. So every press moves the robot for a limited
time: long enough to bridge that pause, and much shorter once the key repeats. A
released key or a lost connection therefore stops the robot.

Of two keys that are held only the later one repeats. A turn key therefore prolongs a
motion ahead or back, so that the robot drives a curve; a key for ahead or back does not
prolong a turn.
"""

import math
from enum import StrEnum
from typing import Final

FIRST_HOLD: Final = 0.7  # s; bridges the pause before a held key repeats
REPEAT_HOLD: Final = 0.3  # s; some repeats may come late over a network
REPEAT_GAP: Final = 0.2  # s; faster presses of one key count as a held key
SPEED_STEP: Final = 0.05  # m/s
TURN_SHARE: Final = 0.3  # share of the speed that wheels have in a turn on the spot


class Key(StrEnum):
    """The effect of a key on the motion."""

    AHEAD = "ahead"
    BACK = "back"
    LEFT = "left"
    RIGHT = "right"
    STOP = "stop"
    FASTER = "faster"
    SLOWER = "slower"


DIRECTIONS: Final = {Key.AHEAD: 1, Key.BACK: -1}
TURNS: Final = {Key.LEFT: 1, Key.RIGHT: -1}
SPEED_CHANGES: Final = {Key.FASTER: SPEED_STEP, Key.SLOWER: -SPEED_STEP}


class Steering:
    """The motion that the keys pressed so far ask for.

    Attributes:
        speed: Speed that the keys set, m/s.
    """

    def __init__(self, speed: float, *, top_speed: float, wheel_separation: float):
        """Start at rest.

        Args:
            speed: Speed that keys set at first, m/s; limited to the top speed.
            top_speed: Top speed of the robot, m/s.
            wheel_separation: Distance between left and right wheels, m.
        """
        self.speed = min(speed, top_speed)
        self._top_speed = top_speed
        self._wheel_separation = wheel_separation
        self._direction = self._turn = (
            0  # 1 ahead and to the left, -1 back and to the right
        )
        self._direction_ends = self._turn_ends = -math.inf
        self._last: tuple[Key, float] | None = None

    def press(self, key: Key, now: float) -> None:
        """Process a key press at a time, s, that never decreases."""
        if key is Key.STOP:
            self._direction = self._turn = 0
        elif key in SPEED_CHANGES:
            speed = round(self.speed + SPEED_CHANGES[key], 9)
            self.speed = max(min(SPEED_STEP, self.speed), min(speed, self._top_speed))
        else:
            self._move(key, now)
        self._last = key, now

    def motion(self, now: float) -> tuple[float, float]:
        """Return the motion at a time.

        Returns:
            Speed ahead, m/s, and turn, rad/s counter-clockwise.
        """
        direction = self._direction if now < self._direction_ends else 0
        turn = self._turn if now < self._turn_ends else 0
        fastest_turn = TURN_SHARE * self.speed / (self._wheel_separation / 2)
        return direction * self.speed, turn * fastest_turn

    def _move(self, key: Key, now: float) -> None:
        ends = now + self._hold(key, now)
        if key in DIRECTIONS:
            self._direction, self._direction_ends = DIRECTIONS[key], ends
            return
        self._turn, self._turn_ends = TURNS[key], ends
        if now < self._direction_ends:
            self._direction_ends = ends

    def _hold(self, key: Key, now: float) -> float:
        if self._last is None:
            return FIRST_HOLD
        last, when = self._last
        return REPEAT_HOLD if last is key and now - when < REPEAT_GAP else FIRST_HOLD
