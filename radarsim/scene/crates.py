"""Crates: boxes that stand in a simulation and that clients may move.

They are no part of the scene: like robots, they stop what meets them and are seen by
all sensors, but only as long as a simulation runs.
"""

from dataclasses import dataclass

from radarsim.scene.victims import Place

MOST_CRATES = 20  # that one line can tell of
SMALLEST, LARGEST = 0.05, 10.0  # m; sides


@dataclass(frozen=True, slots=True)
class Crate:
    """An upright box.

    Attributes:
        name: Its name; no two differ in case alone.
        size: Length, width and height, m.
        position: x, y, z of its middle, m, map frame.
        yaw: Rad, map frame.
    """

    name: str
    size: Place
    position: Place
    yaw: float = 0.0
