"""What a generator puts a map together from: frames, objects and chance."""

import math
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class Frame(NamedTuple):
    """A place on the ground with a direction: m and rad, map frame."""

    x: float
    y: float
    yaw: float = 0.0

    def moved(self, ahead: float, left: float, yaw: float = 0.0) -> "Frame":
        """Return the frame that is so far off, m, and turned further, rad."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        x, y = self.x + c * ahead - s * left, self.y + s * ahead + c * left
        return Frame(x, y, self.yaw + yaw)


class Site:
    """A map that grows object by object, each a line of its file.

    Attributes:
        rng: The generator of all draws.
        lines: A line for each object so far.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        """Begin without any."""
        self.rng = rng
        self.lines: list[str] = []
        self._numbers: Counter[str] = Counter()

    def between(self, low: float, high: float) -> float:
        """Draw a number."""
        return float(self.rng.uniform(low, high))

    def happens(self, probability: float) -> bool:
        """Draw whether something is so."""
        return float(self.rng.random()) < probability

    def one_of(self, names: Sequence[str]) -> str:
        """Draw one of some names; one that is there twice is twice as likely."""
        return names[int(self.rng.integers(len(names)))]

    def put(
        self,
        name: str,
        size: Sequence[float],
        frame: Frame,
        height: float,
        material: str,
        *,
        storeys: tuple[int, float] | None = None,
    ) -> None:
        """Add an object.

        Args:
            name: Its name, to which a number is added.
            size: Three lengths of a box, radius and height of a cylinder, or the radius
                of a sphere, m.
            frame: Where its middle is, and its direction.
            height: That of its middle over the ground, m.
            material: Name of its material.
            storeys: How many of it are above each other, and by how much, m.
        """
        self._numbers[name] += 1
        shape = {1: "sphere", 2: "cylinder", 3: "box"}[len(size)]
        lengths = ", ".join(f"{each:.3f}" for each in size)
        if len(size) > 1:
            lengths = f"[{lengths}]"
        line = f"name: {name}_{self._numbers[name]}, {shape}: {lengths}, position: "
        line += f"[{frame.x:.3f}, {frame.y:.3f}, {height:.3f}], material: {material}"
        if shape == "box":
            line += f", yaw_deg: {math.degrees(frame.yaw):.2f}"
        if storeys is not None:
            line += f", repeat: {{count: {storeys[0]}, step: [0, 0, {storeys[1]:g}]}}"
        self.lines.append(f"  - {{{line}}}\n")
