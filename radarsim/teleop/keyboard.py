"""From key presses to motion.

Theory of operation
===================
Terminals tell of keys that go down, never of keys that come up; a key that is held
repeats, after a pause of up to 0.66 s. So every press moves the robot for a while only:
long enough to bridge that pause, and much shorter once the key is seen to repeat. Who
lets go, loses the connection or falls asleep stops the robot.

Of two keys that are held only the later repeats. A key that turns therefore keeps a
robot going that is on its way, so that it drives a curve; one that goes ahead or back
does not keep it turning.
"""

import math
from enum import StrEnum
from typing import Final

FIRST_HOLD: Final = 0.7  # s; bridges the pause before a held key repeats
REPEAT_HOLD: Final = 0.3  # s; some repeats may come late over a network
REPEAT_GAP: Final = 0.2  # s; faster presses of one key are taken for a held one
SPEED_STEP: Final = 0.05  # m/s
TURN_SHARE: Final = 0.3  # of the speed, for the wheels in a turn on the spot


class Key(StrEnum):
    """What a key does to the motion."""

    AHEAD = "ahead"
    BACK = "back"
    LEFT = "left"
    RIGHT = "right"
    STOP = "stop"
    FASTER = "faster"
    SLOWER = "slower"


WAYS: Final = {Key.AHEAD: 1, Key.BACK: -1}
TURNS: Final = {Key.LEFT: 1, Key.RIGHT: -1}
SPEED_CHANGES: Final = {Key.FASTER: SPEED_STEP, Key.SLOWER: -SPEED_STEP}


class Steering:
    """What the keys that came so far ask of the robot.

    Attributes:
        speed: That keys set, m/s.
    """

    def __init__(self, speed: float, *, top_speed: float, wheel_separation: float):
        """Begin at rest.

        Args:
            speed: That keys set, m/s; at most the top speed is taken.
            top_speed: Of the robot, m/s.
            wheel_separation: m.
        """
        self.speed = min(speed, top_speed)
        self._top_speed = top_speed
        self._wheel_separation = wheel_separation
        self._way = self._turn = 0  # 1 ahead and to the left, -1 back and to the right
        self._way_ends = self._turn_ends = -math.inf
        self._last: tuple[Key, float] | None = None

    def press(self, key: Key, now: float) -> None:
        """Take a key press in, at a time in s that never decreases."""
        if key is Key.STOP:
            self._way = self._turn = 0
        elif key in SPEED_CHANGES:
            speed = round(self.speed + SPEED_CHANGES[key], 9)
            self.speed = max(min(SPEED_STEP, self.speed), min(speed, self._top_speed))
        else:
            self._move(key, now)
        self._last = key, now

    def motion(self, now: float) -> tuple[float, float]:
        """Give the motion at a time.

        Returns:
            Speed ahead, m/s, and turn, rad/s counter-clockwise.
        """
        way = self._way if now < self._way_ends else 0
        turn = self._turn if now < self._turn_ends else 0
        fastest_turn = TURN_SHARE * self.speed / (self._wheel_separation / 2)
        return way * self.speed, turn * fastest_turn

    def _move(self, key: Key, now: float) -> None:
        ends = now + self._hold(key, now)
        if key in WAYS:
            self._way, self._way_ends = WAYS[key], ends
            return
        self._turn, self._turn_ends = TURNS[key], ends
        if now < self._way_ends:
            self._way_ends = ends

    def _hold(self, key: Key, now: float) -> float:
        if self._last is None:
            return FIRST_HOLD
        last, when = self._last
        return REPEAT_HOLD if last is key and now - when < REPEAT_GAP else FIRST_HOLD
