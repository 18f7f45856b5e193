"""Blocks of Stage's models: polygons with a bottom and a top."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from radarsim.geometry import Floats
from radarsim.imports.plan_picture import Mask
from radarsim.imports.source_file import parse_numbers, wrong
from radarsim.imports.stage_reader import Entity, Property

MAX_POINTS: Final = 1000
LARGEST: Final = 1e9  # of all numbers; their differences are at least its inverse


@dataclass(frozen=True, eq=False)
class Block:
    """A block.

    Attributes:
        points: (N, 2) corners, m.
        bottom: Its lowest z, m.
        top: Its highest z, m.
        path: The file that has it.
        line: Where it does.
    """

    points: Floats
    bottom: float
    top: float
    path: Path
    line: int

    def is_upright_rectangle(self) -> bool:
        """Return whether it is a rectangle along the axes."""
        low, high = self.points.min(0), self.points.max(0)
        at_edge = np.isclose(self.points, low) | np.isclose(self.points, high)
        moved = ~np.isclose(self.points, np.roll(self.points, 1, axis=0))
        return len(self.points) == 4 and bool(
            at_edge.all() and (moved.sum(1) == 1).all()
        )

    def rasterize(self, cells: int) -> Mask:
        """Return which cells of its bounding rectangle have their middle in it.

        Args:
            cells: Number of rows, and of columns; the first row is the northernmost.
        """
        low, high = self.points.min(0), self.points.max(0)
        steps = (np.arange(cells) + 0.5) / cells
        x = low[0] + steps * (high[0] - low[0])
        y = (high[1] - steps * (high[1] - low[1]))[:, None]
        inside = np.zeros((cells, cells), bool)
        ends = np.roll(self.points, -1, axis=0)
        for (x0, y0), (x1, y1) in zip(self.points, ends, strict=True):
            if y0 != y1:  # an edge that a line to the east may cross
                crossing = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
                inside ^= ((y0 > y) != (y1 > y)) & (x < crossing)
        return inside


def read_blocks(model: Entity) -> list[Block]:
    """Return the blocks of a model, in units of their own.

    Raises:
        ForeignFileError: If a block has too few or too many points, or is flat.
    """
    return [
        _read_block(child)
        for child in model.all_children()
        if child.root_kind == "block"
    ]


def scale_blocks(
    blocks: list[Block], size: tuple[float, float, float]
) -> Iterable[Block]:
    """Yield blocks scaled so that they fill a model of a size together."""
    points = np.concatenate([block.points for block in blocks])
    low, high = points.min(0), points.max(0)
    factor = np.array(size[:2]) / (high - low)
    tops = [block.top for block in blocks]
    height = size[2] / (max(tops) - min(block.bottom for block in blocks))
    for block in blocks:
        corners = (block.points - (low + high) / 2) * factor
        bottom, top = block.bottom * height, block.top * height
        yield Block(corners, bottom, top, block.path, block.line)


def _read_block(block: Entity) -> Block:
    count = _numbers(block, block.get("points"), 1)[0]
    if not (count.is_integer() and 3 <= count <= MAX_POINTS):
        text = f"a block of {count:g} points, expected 3 to {MAX_POINTS}"
        raise wrong(block.path, block.line, text)
    names = [f"point[{number}]" for number in range(int(count))]
    points = np.array([_numbers(block, block.get(name), 2) for name in names])
    height = block.get("z")
    bottom, top = _numbers(block, height, 2) if height else (0.0, 1.0)
    if max(abs(bottom), abs(top), np.abs(points).max()) > LARGEST:
        text = f"a block, expected coordinates of at most {LARGEST:g}"
        raise wrong(block.path, block.line, text)
    if min(top - bottom, *np.ptp(points, axis=0)) < 1 / LARGEST:
        raise wrong(block.path, block.line, "a flat block, expected one with a volume")
    return Block(points, bottom, top, block.path, block.line)


def _numbers(block: Entity, given: Property | None, count: int) -> list[float]:
    if given is None:
        text = "a block, expected as many point[0], point[1], ... as 'points' counts"
        raise wrong(block.path, block.line, text)
    return parse_numbers(given.path, given.line, given.text, count)
