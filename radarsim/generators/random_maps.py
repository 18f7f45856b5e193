"""Generates random maps of seven families, for trials of navigators.

A map has blocks and cylinders on a flat floor, a start and a goal. The same number
gives the same map. In about a fifth of the maps a fence encloses the goal. Passages
have random widths, including widths that a robot can only just pass.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from radarsim.geometry import Floats, Point
from radarsim.rng import generator_for

SAFETY_DISTANCE: Final = 0.5  # m; safety distance of the trials in all random maps
HALF_LENGTH, HALF_WIDTH = 6.0, 4.5  # m; most objects are in this rectangle
WALL: Final = 0.12  # m; thickness of walls
HEIGHT: Final = 1.4  # m; height of all solids
_FREE: Final = 1.0  # m; least distance of scattered solids from start and goal
_FENCED: Final = 0.2  # share of maps with a fence around the goal
_CLOSED: Final = ("mazes", "offices")  # families whose walls can enclose the goal
STUFF: Final = "stuff"  # material that the map defines; others are in the library


@dataclass(frozen=True, slots=True)
class Block:
    """A box on the floor: its centre and side lengths, m, and its yaw, rad."""

    x: float
    y: float
    length: float
    width: float
    yaw: float = 0.0
    material: str = STUFF

    def distances(self, points: Floats) -> Floats:
        """Return the distances, (N,) m, of points, (N, 2) m, to the box; 0 inside."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        along = (points - (self.x, self.y)) @ np.array([[c, -s], [s, c]])
        outside = np.abs(along) - (self.length / 2, self.width / 2)
        distances: Floats = np.hypot(*np.maximum(outside, 0.0).T)
        return distances

    def as_yaml(self) -> str:
        """Return the box as YAML keys for a map file."""
        size = f"[{self.length:.3f}, {self.width:.3f}, {HEIGHT}]"
        place = f"[{self.x:.3f}, {self.y:.3f}, {HEIGHT / 2}]"
        return f"box: {size}, position: {place}, yaw_deg: {math.degrees(self.yaw):.3f}"


@dataclass(frozen=True, slots=True)
class Disc:
    """An upright cylinder on the floor: its centre and radius, m."""

    x: float
    y: float
    radius: float
    material: str = STUFF

    def distances(self, points: Floats) -> Floats:
        """Return the distances, (N,) m, of points, (N, 2) m, to the disc; 0 inside."""
        from_centre = np.hypot(*(points - (self.x, self.y)).T)
        distances: Floats = np.maximum(from_centre - self.radius, 0.0)
        return distances

    def as_yaml(self) -> str:
        """Return the cylinder as YAML keys for a map file."""
        place = f"[{self.x:.3f}, {self.y:.3f}, {HEIGHT / 2}]"
        return f"cylinder: [{self.radius:.3f}, {HEIGHT}], position: {place}"


Solid = Block | Disc


@dataclass(frozen=True, slots=True)
class RandomMap:
    """One random map, with its solids, start and goal.

    Attributes:
        number: Number of the map, which is its seed.
        family: Name of the family.
        solids: Solids on the floor.
        density: Power that a radar loses per metre in ``STUFF``; ``inf`` is opaque.
        start: Start, m; the robot faces along x.
        goal: Goal, m.
    """

    number: int
    family: str
    solids: tuple[Solid, ...]
    density: float
    start: Point
    goal: Point

    def as_yaml(self) -> str:
        """Return the random map as the text of a map file."""
        density = "opaque" if math.isinf(self.density) else f"{self.density:.3f}"
        objects = (
            f"  - {{name: obstacle_{i}, {solid.as_yaml()},"
            f" material: {solid.material}}}\n"
            for i, solid in enumerate(self.solids)
        )
        goal = f"[{self.goal[0]:.3f}, {self.goal[1]:.3f}]"
        return (
            f"# Random map {self.number} of the family {self.family!r}.\n"
            f"version: 1\nlevel: DM-Random{self.number}\nmaterials:\n"
            f"  floor: {{density: opaque}}\n"
            f"  {STUFF}: {{density: {density}}}\nobjects:\n"
            "  - {name: floor, box: [60, 60, 0.2], position: [0, 0, -0.1],"
            f" material: floor}}\n{''.join(objects)}starts:\n  - {{name: RobotStart1,"
            f" position: [{self.start[0]:.3f}, {self.start[1]:.3f}, 0]}}\n"
            f"trial: {{start: RobotStart1, goal: {goal},"
            f" safety_distance: {SAFETY_DISTANCE}}}\n"
        )


def make_random_map(number: int) -> RandomMap:
    """Return the random map with a number; consecutive maps differ in their family."""
    family = FAMILIES[number % len(FAMILIES)]
    rng = generator_for(number, "random map")
    maker = MapMaker(family, rng)
    solids = list(DRAWERS[family](maker))
    if family not in _CLOSED and maker.between(0, 1) < _FENCED:
        solids += maker.fence()
    places = maker.start, maker.goal
    return RandomMap(number, family, tuple(solids), maker.density, *places)


class MapMaker:
    """Creates one random map.

    Attributes:
        rng: The random generator.
        family: Name of the family of the map.
        density: As in ``RandomMap``.
        start: Start, m.
        goal: Goal, m.
    """

    def __init__(self, family: str, rng: np.random.Generator) -> None:
        self.rng, self.family = rng, family
        self.density = math.inf
        side = HALF_WIDTH - 1.0
        self.start = (-HALF_LENGTH - 0.5, self.between(-side, side))
        self.goal = (HALF_LENGTH - 1.0, self.between(-side, side))

    # Random numbers must be drawn in the same order in all versions. Otherwise all maps
    # change, and results of trials cannot be compared with earlier results.

    def between(self, low: float, high: float) -> float:
        """Draw a uniformly distributed random number."""
        return float(self.rng.uniform(low, high))

    def scattered(self, count: int, draw: Callable[[Point], Solid]) -> Iterator[Solid]:
        """Yield solids at random positions, but not near the start or the goal."""
        ends = np.array([self.start, self.goal])
        for _ in range(count):
            x, y = (self.between(-s, s) for s in (HALF_LENGTH, HALF_WIDTH))
            solid = draw((x, y))
            if solid.distances(ends).min() > _FREE:
                yield solid

    def fence(self) -> Iterator[Solid]:
        """Yield four blocks around the goal; their thickness depends on the family."""
        thick = self.between(0.3, 0.7) if math.isfinite(self.density) else WALL
        if self.family == "thin":
            thick = self.between(0.3, 0.9) / self.density
        x, y, half = *self.goal, self.between(1.0, 1.6)
        for k in range(4):
            angle = k * math.pi / 2
            centre = (x + half * math.cos(angle), y + half * math.sin(angle))
            yield Block(*centre, thick, 2 * half + thick, angle)


Drawer: TypeAlias = Callable[[MapMaker], Iterator[Solid]]


def _boxes(maker: MapMaker) -> Iterator[Solid]:
    def box(place: Point) -> Solid:
        length, width = (maker.between(0.3, 2.5) for _ in range(2))
        return Block(*place, length, width, maker.between(0, math.pi))

    return maker.scattered(int(maker.between(6, 14)), box)


def _bushes(maker: MapMaker) -> Iterator[Solid]:
    maker.density = maker.between(1.5, 4.0)  # a radar penetrates at most 0.67 m

    def bush(place: Point) -> Solid:
        return Disc(*place, maker.between(0.4, 1.0))

    return maker.scattered(int(maker.between(8, 16)), bush)


def _trunks(maker: MapMaker) -> Iterator[Solid]:
    def trunk(place: Point) -> Solid:
        return Disc(*place, maker.between(0.05, 0.25))

    return maker.scattered(int(maker.between(15, 35)), trunk)


def _traps(maker: MapMaker) -> Iterator[Solid]:
    """Yield U-shaped walls between start and goal, with the open side to the start."""
    ends = np.array([maker.start, maker.goal])
    for _ in range(int(maker.between(2, 4))):
        x = maker.between(-HALF_LENGTH, HALF_LENGTH) * 0.6
        share = (x - maker.start[0]) / (maker.goal[0] - maker.start[0])
        y = maker.start[1] + share * (maker.goal[1] - maker.start[1])
        y += maker.between(-1.0, 1.0)
        yaw, half = maker.between(-0.8, 0.8), maker.between(0.8, 2.0)
        depth = maker.between(1.0, 2.5)
        c, s = math.cos(yaw), math.sin(yaw)
        arms = [
            Block(
                x - c * depth / 2 - s * u, y - s * depth / 2 + c * u, depth, WALL, yaw
            )
            for u in (-half, half)
        ]
        trap = [Block(x, y, WALL, 2 * half + WALL, yaw), *arms]
        # If a wall of a trap is near the start or the goal, the trap is left out.
        if min(each.distances(ends).min() for each in trap) > _FREE:
            yield from trap


def _mazes(maker: MapMaker) -> Iterator[Solid]:
    """Yield the walls of a maze of 5 x 4 cells, with some openings or walls added."""
    # scipy is imported only here, since the import is slow.
    from scipy.cluster.hierarchy import DisjointSet  # noqa: PLC0415

    columns, rows, side = 5, 4, 2.2
    rng = maker.rng
    connected = DisjointSet(range(columns * rows))
    inner = [(c, r, 0) for c in range(columns - 1) for r in range(rows)]
    inner += [(c, r, 1) for c in range(columns) for r in range(rows - 1)]
    share = 0.15 if maker.between(0, 1) > _FENCED else -0.15
    for k in rng.permutation(len(inner)).tolist():
        column, row, upward = inner[k]
        cell = column * rows + row
        other = cell + (1 if upward else rows)
        joins = connected.merge(cell, other)
        if (maker.between(0, 1) > -share) if joins else (maker.between(0, 1) < share):
            continue
        x = (column + (0.5 if upward else 1.0) - columns / 2) * side
        y = (row + (1.0 if upward else 0.5) - rows / 2) * side
        yield Block(x, y, side + WALL, WALL, 0.0 if upward else math.pi / 2)
    yield from _outer_walls(columns * side, rows * side)
    cells = rng.permutation(columns * rows)[:2].tolist()
    maker.start, maker.goal = (
        (
            (cell // rows + 0.5 - columns / 2) * side,
            (cell % rows + 0.5 - rows / 2) * side,
        )
        for cell in cells
    )


def _offices(maker: MapMaker) -> Iterator[Solid]:
    """Yield three rooms on each side of a corridor, with doors of random widths."""
    side, corridor = 4.0, 2.4
    narrowest = 1.0 if maker.between(0, 1) < 0.3 else 1.85
    for sign in (-1, 1):
        y = sign * corridor / 2
        for k in range(3):
            x = (k - 1) * side
            door = maker.between(narrowest, 2.4) if maker.between(0, 1) > 0.1 else 0.5
            at = maker.between(-1, 1) * (side - door - 1.0) / 2
            for low, high in ((-side / 2, at - door / 2), (at + door / 2, side / 2)):
                yield Block(x + (low + high) / 2, y, high - low, WALL)
            if k:
                yield Block(x - side / 2, y + sign * side / 2, WALL, side)
            if maker.between(0, 1) < 0.5:  # a desk at the wall
                desk = maker.between(0.6, 1.4)
                yield Block(x, y + sign * (side - WALL / 2 - 0.25), desk, 0.5)
    yield from _outer_walls(3 * side, 2 * side + corridor)
    rooms = maker.rng.permutation(6)[:2].tolist()
    maker.start, maker.goal = (
        ((room % 3 - 1) * side, (1 if room < 3 else -1) * (corridor + side) / 2)
        for room in rooms
    )


def _thin(maker: MapMaker) -> Iterator[Solid]:
    """Yield bushes and hedges that a radar penetrates."""
    maker.density = maker.between(0.5, 1.5)

    def bush(place: Point) -> Solid:
        chord = maker.between(0.3, 0.9) / maker.density
        if maker.between(0, 1) < 0.5:
            return Disc(*place, chord / 2)
        return Block(*place, chord, maker.between(0.5, 3.0), maker.between(0, math.pi))

    return maker.scattered(int(maker.between(6, 14)), bush)


def _outer_walls(length: float, width: float) -> Iterator[Solid]:
    for sign in (-1, 1):
        yield Block(0.0, sign * width / 2, length + WALL, WALL)
        yield Block(sign * length / 2, 0.0, WALL, width + WALL)


DRAWERS: Final[dict[str, Drawer]] = {
    "boxes": _boxes,
    "bushes": _bushes,
    "trunks": _trunks,
    "traps": _traps,
    "mazes": _mazes,
    "offices": _offices,
    "thin": _thin,
}
FAMILIES: Final = tuple(DRAWERS)
