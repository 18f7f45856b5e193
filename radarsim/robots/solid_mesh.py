"""The triangles of many parts, of which those near a place are sliced fast.

Triangles are sorted by cells of space and cut into blocks of equal size. A slice looks
at the bounds of all blocks, and only then at the triangles of those that it meets: how
long it takes hardly depends on the size of a map.
"""

import math
from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple

import numpy as np

from radarsim.engine import engine
from radarsim.geometry import Floats
from radarsim.scene.scene import Part
from radarsim.scene.shapes import Faces, Mesh, concatenate

_BLOCK: Final = 32  # triangles
_CELL: Final = np.array([0.5, 0.5, 0.2])  # m
_NOTHING: Final[Mesh] = (np.zeros((0, 3)), np.zeros((0, 3), np.int32))


class Area(NamedTuple):
    """A rectangle of the map, m."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float


class SolidMesh:
    """The triangles of the solid ones among some parts."""

    def __init__(self, parts: Iterable[Part]) -> None:
        """Sort the triangles of the solid ones among some parts."""
        solid = [(p.vertices, p.faces) for p in parts if p.material.solid]
        self._vertices, self._faces = map(
            np.ascontiguousarray, concatenate(solid or [_NOTHING])
        )
        count = len(self._faces)
        cells = np.zeros((3, count), np.float32)
        for some in _chunks(count):
            lows, highs = self._bounds(self._faces[some])
            cells[:, some] = np.floor((lows + highs) / 2 / _CELL).T
        self._order = np.lexsort(cells).astype(np.int32)
        self._lows, self._highs = np.zeros((2, 3, math.ceil(count / _BLOCK)))
        for some in _chunks(count):
            lows, highs = self._bounds(self._faces[self._order[some]])
            firsts = np.arange(0, len(lows), _BLOCK)
            blocks = some.start // _BLOCK + np.arange(len(firsts))
            self._lows[:, blocks] = np.minimum.reduceat(lows, firsts).T
            self._highs[:, blocks] = np.maximum.reduceat(highs, firsts).T
        self._packed = engine.structures["SolidMesh"].pack(
            vertices=self._vertices,
            faces=self._faces,
            order=self._order,
            lows=self._lows,
            highs=self._highs,
        )
        self._room = np.zeros(0, np.int32), np.zeros((0, 2, 2))

    def slice(self, area: Area, height: float) -> Floats:
        """Slice the triangles in an area at one height.

        Args:
            area: The area.
            height: z of the plane, m, map frame.

        Returns:
            Line segments, as of ``slice_mesh``, in the order of the parts and of their
            faces: all that reach into the area, and perhaps others.
        """
        while (count := self._slice(area, height)) < 0:
            self._room = np.zeros(-count, np.int32), np.zeros((-count, 2, 2))
        return self._room[1][:count].copy()

    def _slice(self, area: Area, height: float) -> int:
        """Fill the room with the slice; return its size, or minus the room needed."""
        count: int = engine.slice_area(self._packed, *area, height, *self._room)
        return count

    def _bounds(self, faces: Faces) -> tuple[Floats, Floats]:
        """Return the smallest and the largest coordinates of triangles, (N, 3) m."""
        a, b, c = (self._vertices[corners] for corners in faces.T)
        return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _chunks(count: int) -> Iterator[slice]:
    """Divide triangles: bounds of millions at once would fill the memory."""
    size = 4096 * _BLOCK
    return (slice(first, first + size) for first in range(0, count, size))
