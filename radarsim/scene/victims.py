"""Victims and RFID tags: what the sensors of rescue robots look for.

A victim lies on the floor. It is no obstacle, and neither scanners nor cameras see it:
who wants that adds an object. Its parts are where those of a man of average size are
(height 1.75 m, an estimate), measured along the body from the pelvis.
"""

import math
from dataclasses import dataclass
from typing import Final

Place = tuple[float, float, float]

# Part, along the body towards the head and to its left, m.
PARTS: Final = (
    ("Head", 0.75, 0.0),
    ("Chest", 0.40, 0.0),
    ("Pelvis", 0.0, 0.0),
    ("Arm", 0.35, 0.30),
    ("Arm", 0.35, -0.30),
    ("Hand", 0.0, 0.40),
    ("Hand", 0.0, -0.40),
    ("Leg", -0.45, 0.12),
    ("Leg", -0.45, -0.12),
    ("Foot", -0.90, 0.12),
    ("Foot", -0.90, -0.12),
)


@dataclass(frozen=True, slots=True)
class Tag:
    """An RFID tag.

    Attributes:
        id: Its number.
        position: x, y, z, m, map frame.
    """

    id: int
    position: Place


@dataclass(frozen=True, slots=True)
class Victim:
    """Somebody who lies on the floor.

    Attributes:
        name: Name in the map.
        position: x, y, z of the pelvis, m, map frame.
        yaw: Direction from the feet to the head, rad, map frame.
        moves: Whether sensors of motion react.
        loudness: How loud the victim calls, dB at a distance of 1 m; None if not.
        duration: How long each call lasts, s.
        co2: Share of carbon dioxide in its breath, %; 0 if it does not breathe.
    """

    name: str
    position: Place
    yaw: float = 0.0
    moves: bool = False
    loudness: float | None = None
    duration: float = 1.0
    co2: float = 0.0

    @property
    def head(self) -> Place:
        """The place of the head, m, map frame."""
        return self.parts[0][1]

    @property
    def parts(self) -> list[tuple[str, Place]]:
        """The parts of the body, each with its place, m, map frame."""
        x, y, z = self.position
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return [
            (part, (x + along * c - left * s, y + along * s + left * c, z))
            for part, along, left in PARTS
        ]
