"""What is cast, and what comes of it: named columns, a row for each ray."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.raycast.penetration import EventKind

RADAR: Final = 0
LASER: Final = 1


@dataclass(frozen=True, slots=True)
class Rays:
    """What is cast at once.

    Attributes:
        origins: (N, 3) m, map frame.
        directions: (N, 3) unit vectors, map frame.
        reach: (N,) m, inclusive.
        power: (N,) penetration power.
        medium: (N,) uint8, ``RADAR`` or ``LASER``: which densities count.
        own: (N,) int64, the number of the box that does not stop the ray; -1 for none.
    """

    origins: Floats
    directions: Floats
    reach: Floats
    power: Floats
    medium: NDArray[np.uint8]
    own: NDArray[np.int64]

    @classmethod
    def alike(
        cls,
        origins: Floats,
        directions: Floats,
        *,
        reach: float,
        power: float = np.inf,
        medium: int = RADAR,
        own: int = -1,
    ) -> "Rays":
        """Make rays that differ only in where they are."""
        n = len(origins)
        return cls(
            np.ascontiguousarray(origins, np.float64),
            np.ascontiguousarray(directions, np.float64),
            np.full(n, reach, np.float64),
            np.full(n, power, np.float64),
            np.full(n, medium, np.uint8),
            np.full(n, own, np.int64),
        )

    @classmethod
    def joined(cls, batches: "Sequence[Rays]") -> "Rays":
        """Put batches behind one another; at least one."""
        columns = (field.name for field in fields(cls))
        return cls(
            *(np.concatenate([getattr(b, name) for b in batches]) for name in columns)
        )


@dataclass(frozen=True, slots=True)
class Traces:
    """Where rays ended.

    Attributes:
        ranges: (N,) m; inf where nothing came back.
        outcomes: (N,) uint8, an ``Outcome`` each.
        parts: (N,) int64, the index of the part that was hit, or in which the power ran
            out; of a box, the number of parts + its number; -1 for nothing.
        power: (N,) what is left.
    """

    ranges: Floats
    outcomes: NDArray[np.uint8]
    parts: NDArray[np.int64]
    power: Floats

    def split(self, sizes: Sequence[int]) -> "list[Traces]":
        """Give the traces of batches that were joined, by their sizes."""
        edges = np.cumsum([0, *sizes]).tolist()
        columns = [getattr(self, field.name) for field in fields(self)]
        return [
            Traces(*(column[start:end] for column in columns))
            for start, end in pairwise(edges)
        ]


@dataclass(frozen=True, slots=True)
class Event:
    """What happened to a ray at one point.

    Attributes:
        t: m from its start.
        kind: What.
        part: With which part or box, as in ``Traces``.
        power: What the ray has left there; behind the surface, for a sheet.
    """

    t: float
    kind: EventKind
    part: int
    power: float


def check_rays(rays: Rays) -> None:
    """Refuse what compiled code would read past the end of, or Embree misread.

    Raises:
        EngineError: If shapes disagree or numbers are not finite.
    """
    n = len(rays.origins)
    for name, array, shape in (
        ("origins", rays.origins, (n, 3)),
        ("directions", rays.directions, (n, 3)),
        ("reach", rays.reach, (n,)),
        ("power", rays.power, (n,)),
        ("medium", rays.medium, (n,)),
        ("own", rays.own, (n,)),
    ):
        if array.shape != shape:
            raise EngineError(f"{name} of shape {array.shape}, expected {shape}")
    for name, array in (("origins", rays.origins), ("directions", rays.directions)):
        if not np.isfinite(array).all():
            row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
            raise EngineError(
                f"{name}[{row}] is {array[row].tolist()}, expected finite numbers"
            )
    lengths = np.einsum("ij,ij->i", rays.directions, rays.directions)
    if not np.allclose(lengths, 1.0, rtol=0, atol=1e-9):
        row = int(np.argmax(np.abs(lengths - 1.0)))
        raise EngineError(
            f"directions[{row}] has length {lengths[row] ** 0.5:.9g}, expected 1"
        )
    if rays.medium.size and rays.medium.max() > LASER:
        raise EngineError(f"medium {rays.medium.max()}, expected {RADAR} or {LASER}")
