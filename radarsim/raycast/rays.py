"""The input and output of the ray tracer as arrays: rays, robot boxes and traces."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import accumulate, pairwise
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarsim.engine import Packed, engine
from radarsim.errors import EngineError
from radarsim.geometry import Floats

Sides: TypeAlias = NDArray[np.int8]  # side of each ray in its beam: -1, 0 or 1
Nodes: TypeAlias = NDArray[np.int16]  # index of each ray's node in its beam

# The dtype of an event, with the fields of ``Event``.
EVENT: Final = engine.rows["Event"]
Events: TypeAlias = NDArray[np.void]  # rows of dtype EVENT


class Outcome(IntEnum):
    """Reasons why a ray ends; ``attenuation.hpp`` has the theory."""

    NOTHING = 0
    HIT = 1
    SPENT = 2
    ABSORBED = 3


class EventKind(IntEnum):
    """The kind of an event at one point of a ray's path."""

    START_INSIDE = 0
    ENTER = 1
    LEAVE = 2
    SHEET = 3
    HIT = 4
    SPENT = 5
    OUT_OF_RANGE = 6
    MIRRORED = 7
    ABSORBED = 8
    RAIN = 9  # added by sensors, since rain has no surfaces


RADAR: Final = 0
LASER: Final = 1
SONAR: Final = 2


class RayClass(NamedTuple):
    """The properties of rays that determine how materials affect the rays.

    Attributes:
        medium: Sensor type ``RADAR``, ``LASER`` or ``SONAR``, which selects the values
            of a material. Materials that stop robots or light stop sonars.
        band: Index into ``BANDS_GHZ``; only for radars.
        power_per_db: Penetration power per decibel of attenuation.
        max_reflections: Maximum number of mirror reflections; the next mirror ends the
            ray like any other surface.
        is_absorbed: Whether opaque surfaces that are not mirrors absorb power; false
            for a radar that computes the backscatter of surfaces.
        in_decibels: Whether ``attenuation_db`` and ``sheet_attenuation_db`` of
            materials apply if given, and rays ignore the meshes of point reflectors.
        glint: Angle of incidence on a mirror, rad, up to which the mirror ends the ray
            like any other surface; 0 for none.
    """

    medium: int
    band: int = 2
    power_per_db: float = 1.0
    max_reflections: int = 0
    is_absorbed: bool = True
    in_decibels: bool = False
    glint: float = 0.0


DEFAULT_CLASSES: Final = (RayClass(RADAR), RayClass(LASER))


_NO_NODES: Final = engine.structures["NodeTable"].pack(
    directions=np.zeros((0, 0, 3)),
    starts=np.zeros((0, 0, 3)),
    edges=np.zeros(0),
    sides=np.zeros(0, np.int8),
)
_COLUMNS: Final = (
    "origins", "directions", "max_range", "power", "class_index", "carrier_id"
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Rays:
    """Rays to be traced together.

    Attributes:
        origins: (N, 3) m, map frame.
        directions: (N, 3) unit vectors, map frame.
        max_range: (N,) m, inclusive, finite.
        power: (N,) initial penetration power.
        class_index: (N,) uint8, index into ``ray_classes``; with ``DEFAULT_CLASSES``,
            ``RADAR`` or ``LASER``.
        carrier_id: (N,) int64, the id of the robot box that carries the sensor and does
            not stop the ray; -1 for none.
        ray_classes: The ray classes, at most 255.
    """

    origins: Floats
    directions: Floats
    max_range: Floats
    power: Floats
    class_index: NDArray[np.uint8]
    carrier_id: NDArray[np.int64]
    ray_classes: tuple[RayClass, ...] = DEFAULT_CLASSES

    @classmethod
    def uniform(
        cls,
        origins: Floats,
        directions: Floats,
        *,
        max_range: ArrayLike,
        power: float = np.inf,
        medium: int = RADAR,
        carrier_id: ArrayLike = -1,
        ray_classes: tuple[RayClass, ...] = DEFAULT_CLASSES,
    ) -> "Rays":
        """Create rays of equal power and of one class, ``ray_classes[medium]``."""
        n = len(origins)
        return cls(
            np.ascontiguousarray(origins, np.float64),
            np.ascontiguousarray(directions, np.float64),
            np.full(n, max_range, np.float64),
            np.full(n, power, np.float64),
            np.full(n, medium, np.uint8),
            np.full(n, carrier_id, np.int64),
            ray_classes,
        )

    @classmethod
    def concatenate(cls, batches: "Sequence[Rays]") -> "Rays":
        """Join one or more batches of rays, in their order."""
        if len(batches) == 1:
            return batches[0]
        columns = {
            name: np.concatenate([getattr(batch, name) for batch in batches])
            for name in _COLUMNS
        }
        every = (each for batch in batches for each in batch.ray_classes)
        classes = tuple(dict.fromkeys(every))
        if len(classes) > 1:  # batches may have different class indices
            indices = []
            for batch in batches:
                index = [classes.index(each) for each in batch.ray_classes]
                indices.append(np.array(index, np.uint8)[batch.class_index])
            columns["class_index"] = np.concatenate(indices)
        return cls(**columns, ray_classes=classes)

    def take(self, rows: NDArray[np.int64]) -> "Rays":
        """Return the rays with the given indices."""
        columns = {name: getattr(self, name)[rows] for name in _COLUMNS}
        return Rays(**columns, ray_classes=self.ray_classes)

    def invalid(self, row: int) -> EngineError:
        """Return the error that describes an invalid ray."""
        place, way = self.origins[row].tolist(), self.directions[row].tolist()
        return EngineError(
            f"ray {row} from {place} along {way}, max_range {self.max_range[row]},"
            f" power {self.power[row]}, class {self.class_index[row]} of"
            f" {len(self.ray_classes)}: expected finite numbers, a direction of length"
            " 1, a power of at least 0, and an existing class"
        )

    def pack(self) -> Packed:
        """Pack the rays for the engine.

        Raises:
            EngineError: If a column has a wrong shape or dtype.
        """
        return engine.structures["RaySource"].pack(
            origins=np.ascontiguousarray(self.origins),
            directions=np.ascontiguousarray(self.directions),
            max_range=np.ascontiguousarray(self.max_range),
            power=np.ascontiguousarray(self.power),
            class_index=np.ascontiguousarray(self.class_index),
            carrier=np.ascontiguousarray(self.carrier_id),
            table=_NO_NODES,
            radius=0.0,
        )


ROBOT_BOX: Final = engine.rows["RobotBox"]
NO_BOXES: Final = np.zeros(0, ROBOT_BOX)


@dataclass(frozen=True, slots=True)
class Boxes:
    """The boxes of robots: upright boxes that stop every ray.

    Attributes:
        rows: (B, 8): x, y, yaw, lower and upper z, half the length, half the width
            (m, rad), and the id of the box.
        velocities: (B, 2) m/s, along x and y; None if they are not needed.

    Raises:
        EngineError: If the rows have another shape, or are not finite.
    """

    rows: Floats
    velocities: Floats | None = None
    _tables: dict[bytes, NDArray[np.void]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def __post_init__(self) -> None:
        rows = np.asarray(self.rows, np.float64)
        if rows.ndim != 2 or rows.shape[1] != 8:
            raise EngineError(f"boxes of shape {rows.shape}, expected (n, 8)")
        if not np.isfinite(rows).all():
            row = int(np.flatnonzero(~np.isfinite(rows).all(axis=1))[0])
            raise EngineError(
                f"boxes[{row}] is {rows[row].tolist()}, expected finite numbers"
            )
        object.__setattr__(self, "rows", rows)

    def find(
        self, ids: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Find boxes by id; return the indices of the found ids, and of their boxes."""
        known = self.rows[:, 7].astype(np.int64)
        found = np.flatnonzero(np.isin(ids, known))
        order = np.argsort(known)
        return found, order[np.searchsorted(known, ids[found], sorter=order)]

    def table(self, centre: Floats) -> NDArray[np.void]:
        """Return the boxes as ROBOT_BOX rows for the engine, cached by ``centre``.

        Args:
            centre: (3,) m, origin of the coordinates in the table.
        """
        key = centre.tobytes()
        if key not in self._tables:
            self._tables[key] = self._tabulate(centre)
        return self._tables[key]

    def _tabulate(self, centre: Floats) -> NDArray[np.void]:
        x, y, yaw, low, high, length, width, box_id = self.rows.T
        table = np.zeros(len(x), ROBOT_BOX)
        table["x"], table["y"] = x - centre[0], y - centre[1]
        table["z"], table["height"] = (low + high) / 2 - centre[2], (high - low) / 2
        table["cos"], table["sin"] = np.cos(yaw), np.sin(yaw)
        table["length"], table["width"] = length, width
        table["footprint_radius"] = np.hypot(length, width)
        table["id"] = box_id
        return table


class Traces(NamedTuple):
    """The results of tracing N rays.

    Attributes:
        ranges: (N,) m, over all segments of the path; inf where nothing was hit.
        outcomes: (N,) uint8, the ``Outcome`` of each ray.
        parts: (N,) int64, index of the part that was hit or absorbed the ray, or in
            which the power ran out; for a robot box, the number of parts plus the
            box's id; -1 for none.
        power: (N,) remaining power; at a hit, after the absorption by the surface.
        incidence: (N,) cosine of the angle between the ray and the normal of the opaque
            surface that it hit, 0 to 1; nan without a hit; empty if not requested.
        events: Rows of EVENT, ordered by ray and by distance; empty if not requested.
    """

    ranges: Floats
    outcomes: NDArray[np.uint8]
    parts: NDArray[np.int64]
    power: Floats
    incidence: Floats
    events: NDArray[np.void]

    def split(self, sizes: Sequence[int]) -> "list[Traces]":
        """Split the traces of joined batches of rays, given the size of each batch."""
        edges = [0, *accumulate(sizes)]
        cuts = np.searchsorted(self.events["ray"], edges).tolist()
        pieces = []
        for (start, end), (first, last) in zip(
            pairwise(edges), pairwise(cuts), strict=True
        ):
            columns = {
                name: getattr(self, name)[start:end] for name in self._fields[:-1]
            }
            events = self.events[first:last].copy()
            events["ray"] -= start
            pieces.append(Traces(**columns, events=events))
        return pieces


@dataclass(frozen=True, slots=True)
class Event:
    """An event at one point of a ray's path.

    Attributes:
        t: Distance from the ray's origin along its path, m.
        kind: Kind of the event.
        part: The part or robot box involved, numbered as in ``Traces.parts``.
        power: Power of the ray on arrival.
        absorbed: Power that a sheet or an opaque surface absorbs there.
        position: (x, y, z) m, map frame.
    """

    t: float
    kind: EventKind
    part: int
    power: float
    absorbed: float = 0.0
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
