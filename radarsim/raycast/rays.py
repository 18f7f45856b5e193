"""What is cast, and what comes of it: named columns, a row for each ray."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Any, Final, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.jit import njit_inline
from radarsim.raycast.attenuation import EventKind

RADAR: Final = 0
LASER: Final = 1


class RayClass(NamedTuple):
    """What rays have in common that a scene takes alike.

    Attributes:
        medium: ``RADAR`` or ``LASER``: which numbers of the materials count.
        band: Which of ``BANDS_GHZ``; of no meaning to a laser.
        power_per_db: What a dB is in penetration power.
        bounces: How often mirrors reflect a ray; after that they are surfaces.
    """

    medium: int
    band: int = 2
    power_per_db: float = 1.0
    bounces: int = 0


PLAIN: Final = (RayClass(RADAR), RayClass(LASER))
COLUMNS: Final = ("origins", "directions", "reach", "power", "medium", "own")
UNIT: Final = 2e-9  # how far a direction's squared length may be from 1


@dataclass(frozen=True, slots=True)
class Rays:
    """What is cast at once.

    Attributes:
        origins: (N, 3) m, map frame.
        directions: (N, 3) unit vectors, map frame.
        reach: (N,) m, inclusive.
        power: (N,) penetration power.
        medium: (N,) uint8, which of ``kinds`` each is; with ``PLAIN``, ``RADAR`` or
            ``LASER``.
        own: (N,) int64, the number of the box that does not stop the ray; -1 for none.
        kinds: Those that there are; at most 255.
    """

    origins: Floats
    directions: Floats
    reach: Floats
    power: Floats
    medium: NDArray[np.uint8]
    own: NDArray[np.int64]
    kinds: tuple[RayClass, ...] = PLAIN

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
        kinds = batches[0].kinds
        if any(batch.kinds != kinds for batch in batches):
            kinds = tuple(dict.fromkeys(kind for b in batches for kind in b.kinds))
            batches = [batch.of_kinds(kinds) for batch in batches]
        columns: list[Any] = [
            np.concatenate([getattr(batch, name) for batch in batches])
            for name in COLUMNS
        ]
        return cls(*[*columns, kinds])

    def of_kinds(self, kinds: tuple[RayClass, ...]) -> "Rays":
        """Give the same rays with their kinds out of others; all must be there."""
        numbers = np.array([kinds.index(kind) for kind in self.kinds], np.uint8)
        return replace(self, medium=numbers[self.medium], kinds=kinds)

    def take(self, rows: NDArray[np.int64]) -> "Rays":
        """Give some of the rays."""
        columns: list[Any] = [getattr(self, name)[rows] for name in COLUMNS]
        return Rays(*[*columns, self.kinds])


@dataclass(frozen=True, slots=True)
class Traces:
    """Where rays ended.

    Attributes:
        ranges: (N,) m, along all legs of the way; inf where nothing came back.
        outcomes: (N,) uint8, an ``Outcome`` each.
        parts: (N,) int64, the index of the part that was hit or absorbed the ray, or in
            which the power ran out; of a box, the number of parts + its number; -1 for
            nothing.
        power: (N,) what is left; of a hit, what comes back.
        incidence: (N,) cosine of the angle between the ray and the normal of the opaque
            surface that it hit, 0 to 1; nan where it hit none; empty if not asked for.
        events: A row of EVENT for each thing that happened, ray by ray, in the order
            of the way; empty if not asked for.
    """

    ranges: Floats
    outcomes: NDArray[np.uint8]
    parts: NDArray[np.int64]
    power: Floats
    incidence: Floats
    events: NDArray[np.void]

    def split(self, sizes: Sequence[int]) -> "list[Traces]":
        """Give the traces of batches that were joined, by their sizes."""
        edges = np.cumsum([0, *sizes]).tolist()
        columns: list[Any] = [getattr(self, field.name) for field in fields(self)[:-1]]
        return [
            Traces(*[*(column[start:end] for column in columns), events])
            for (start, end), events in zip(
                pairwise(edges), self._split_events(edges), strict=True
            )
        ]

    def _split_events(self, edges: list[int]) -> list[NDArray[np.void]]:
        if not len(self.events):
            return [self.events] * (len(edges) - 1)
        cuts = np.searchsorted(self.events["ray"], edges).tolist()
        pieces = [self.events[start:end].copy() for start, end in pairwise(cuts)]
        for first, piece in zip(edges[:-1], pieces, strict=True):
            piece["ray"] -= first
        return pieces


@dataclass(frozen=True, slots=True)
class Event:
    """What happened to a ray at one point.

    Attributes:
        t: m from its start.
        kind: What.
        part: With which part or box, as in ``Traces``.
        power: What the ray has left on arrival there.
        kept: What a sheet or an opaque surface keeps of it.
        place: (x, y, z) m, map frame.
    """

    t: float
    kind: EventKind
    part: int
    power: float
    kept: float = 0.0
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)


def columns_of(rays: Rays) -> tuple[NDArray[Any], ...]:
    """Give the columns in order, as compiled code takes them.

    Raises:
        EngineError: If shapes or kinds of numbers are not those of ``Rays``.
    """
    n = len(rays.origins)
    columns: list[NDArray[Any]] = []
    for name, array, shape, kind in (
        ("origins", rays.origins, (n, 3), np.float64),
        ("directions", rays.directions, (n, 3), np.float64),
        ("reach", rays.reach, (n,), np.float64),
        ("power", rays.power, (n,), np.float64),
        ("medium", rays.medium, (n,), np.uint8),
        ("own", rays.own, (n,), np.int64),
    ):
        if array.shape != shape:
            raise EngineError(f"{name} of shape {array.shape}, expected {shape}")
        if array.dtype != kind:
            raise EngineError(f"{name} of {array.dtype}, expected {np.dtype(kind)}")
        # For arrays that are laid out otherwise all would be compiled once more.
        plain = array.flags.c_contiguous and array.flags.writeable
        columns.append(array if plain else array.copy())
    return tuple(columns)


@njit_inline
def is_fit(origin: Any, direction: Any, reach: Any, power: Any) -> Any:
    """Say whether one ray has finite numbers, and a unit vector."""
    length = 0.0
    for axis in range(3):
        length += direction[axis] ** 2
        if not np.isfinite(origin[axis]):
            return False
    if not abs(length - 1.0) <= UNIT:
        return False
    return reach >= 0.0 and power >= 0.0


def refuse(rays: Rays, row: int) -> NoReturn:
    """Say what is wrong with a ray that is not fit.

    Raises:
        EngineError: Always.
    """
    for name in ("origins", "directions"):
        numbers = getattr(rays, name)[row]
        if not np.isfinite(numbers).all():
            text = f"{name}[{row}] is {numbers.tolist()}, expected finite numbers"
            raise EngineError(text)
    for name in ("reach", "power"):
        number = float(getattr(rays, name)[row])
        if not number >= 0.0:
            raise EngineError(f"{name}[{row}] is {number}, expected at least 0")
    most = len(rays.kinds) - 1
    if rays.medium[row] > most:
        text = f"medium[{row}] is {rays.medium[row]}, expected 0 to {most}"
        raise EngineError(text)
    length = float(np.linalg.norm(rays.directions[row]))
    raise EngineError(f"directions[{row}] has length {length:.9g}, expected 1")
