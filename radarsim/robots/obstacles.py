"""The obstacles on a floor: walls, which are horizontal slices of solid objects.

The walls near a position are found in a grid of square cells. A wall has an entry in
each cell that it crosses. Cells are numbered row by row and the entries are sorted by
cell number, so neighbouring cells in a row are one run of entries, and empty cells take
no memory on maps of any size.
"""

import math
from collections.abc import Callable, Generator, Iterator, Sequence
from functools import cache, cached_property
from typing import TYPE_CHECKING, Final, NamedTuple, TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Geometry

from radarsim.engine import Packed, engine
from radarsim.geometry import Floats, Pose2
from radarsim.robots.footprint import (
    LINE,
    MARGIN,
    NO_SEGMENTS,
    Footprint,
    Lines,
    line_table,
)
from radarsim.scene.scene import Scene

if TYPE_CHECKING:
    from radarsim.robots.robot import Robot

Result = TypeVar("Result")

# Heights of the slices above the floor, m, from a P3AT's bumpers to the top of its
# payload. Thin horizontal objects between two heights are not detected.
BUMPER_HEIGHTS = (0.058, 0.15, 0.25, 0.35, 0.45)

_MIN_LENGTH = 1e-9  # m; shorter segments have no direction and are dropped
_SEARCH_STEP = 0.05  # m between candidate positions
_BATCH = 128  # candidate positions per step of the search
_CLEARANCE = 0.01  # m around the footprint at a candidate position
_LINES = 512  # lines per step of the search
# Estimated costs of testing a position without lines, sorting a line, and calling
# `is_open`, relative to the cost of comparing one position with one line.
_POSITION_WORK = 300
_SORTING_WORK = 30
_TRACING_WORK = 40_000
_DIGITS = 6  # decimals of rounded end points, so that adjacent lines share them

# Sizes of the grid of walls and of its tables.
_MIN_CELL: Final = 1.0  # m; larger if long walls would cross too many cells
_ENTRIES_PER_WALL: Final = 16
_FREE_ENTRIES: Final = 65536
_FEW_WALLS: Final = 64
_SPARE_ROWS: Final = np.array([16384, 32768, 512])  # spare walls, entries, floors
WALL_ENTRY: Final = engine.rows["WallEntry"]
WALL_GRID: Final = engine.rows["WallGrid"]


def slice_mesh(vertices: Floats, faces: NDArray[np.int32], height: float) -> Floats:
    """Slice a mesh at one height.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3) rows of vertex numbers.
        height: z of the plane, m. A vertex in the plane counts as above it, so the
            slice of a closed mesh is closed, and a mesh that stands on the plane has
            no slice.

    Returns:
        Line segments, (S, 2, 2) m: x and y of both ends, which are equal where the
        plane only touches a corner.

    Raises:
        ValueError: If a face has the number of a vertex that does not exist.
    """
    segments = np.zeros((len(faces), 2, 2))
    vertices = np.ascontiguousarray(vertices, np.float64)
    faces = np.ascontiguousarray(faces, np.int32)
    count = engine.slice_faces(vertices, faces, height, segments)
    if count < 0:
        raise ValueError(f"a face has a vertex number outside 0 to {len(vertices) - 1}")
    return segments[:count].copy()


class FloorWalls(NamedTuple):
    """The walls of one floor, with indices that count from 0.

    Attributes:
        lines: (S,) the walls.
        entries: (E,) of type ``WALL_ENTRY``, sorted by cell.
        grid: (1,) of type ``WALL_GRID``.
    """

    lines: Lines
    entries: NDArray[np.void]
    grid: NDArray[np.void]


def pack_walls(
    lines: Lines, entries: NDArray[np.void], floors: NDArray[np.void]
) -> Packed:
    """Pack the walls of several floors into a structure of type ``Walls``."""
    return engine.structures["Walls"].pack(
        lines=lines,
        entries=entries,
        floors=floors,
        marks=np.zeros(len(lines), np.int64),
        searches=np.zeros(1, np.int64),
    )


def floor_walls(segments: Floats) -> FloorWalls:
    """Index the walls of a floor: segments, (S, 2, 2) m, x and y of both ends."""
    lines = line_table(segments)
    if len(segments) <= _FEW_WALLS:
        # A single infinite cell is used, since checking few walls is faster than
        # sorting them.
        entries = np.zeros(len(segments), WALL_ENTRY)
        entries["wall"] = np.arange(len(segments))
        endless = (0.0, 0.0, np.inf, 1, 1, 0, len(segments), 0)
        return FloorWalls(lines, entries, np.array([endless], WALL_GRID))
    segments = np.ascontiguousarray(segments, np.float64)
    size = _cell_size(segments)
    left, bottom = segments.reshape(-1, 2).min(axis=0) - size
    grid = np.array([(left, bottom, size, 1, 1, 0, 0, 0)], WALL_GRID)
    entries = np.zeros(0, WALL_ENTRY)
    entries = np.zeros(engine.enter_crossings(segments, grid, entries), WALL_ENTRY)
    engine.enter_crossings(segments, grid, entries)
    grid["end"] = len(entries)
    order = np.argsort(entries["cell"], kind="stable")
    return FloorWalls(lines, entries[order], grid)


class WallStore:
    """The walls of several floors, in arrays with spare room for more floors.

    Floors are only added, and entries of the table never change, so references to the
    table stay valid.

    Attributes:
        table: The table, of type ``Walls``.
        lines: The number of wall segments for which the table has room.
    """

    def __init__(self, floors: Sequence[FloorWalls] = ()) -> None:
        """Create a table with spare room; without floors the table has no room."""
        needed = sum(map(_sizes, floors), np.zeros(3, np.int64))
        room = (2 * needed + (_SPARE_ROWS if floors else 0)).tolist()
        types = LINE, WALL_ENTRY, WALL_GRID
        self._tables = tuple(map(np.zeros, room, types))
        self.table = pack_walls(*self._tables)
        self.lines = room[0]
        self._used = np.zeros(3, np.int64)
        for floor in floors:
            self.add(floor)

    def add(self, floor: FloorWalls) -> bool:
        """Add a floor; its number is the number of floors before it.

        Returns:
            Whether there was room for the floor; if not, the table is unchanged.
        """
        end = self._used + _sizes(floor)
        if (end > [len(rows) for rows in self._tables]).any():
            return False
        walls, first, _ = self._used.tolist()
        pieces = zip(self._tables, self._used.tolist(), end.tolist(), strict=True)
        lines, entries, grid = (table[start:stop] for table, start, stop in pieces)
        lines[:], entries[:], grid[:] = floor
        grid["first_line"] = walls
        grid["first"] += first
        grid["end"] += first
        self._used = end
        return True


def _sizes(floor: FloorWalls) -> NDArray[np.int64]:
    """Return how many rows a floor needs for walls, grid entries and grids, (3,)."""
    return np.array([len(floor.lines), len(floor.entries), 1])


def _cell_size(segments: Floats) -> float:
    """Return a size of grid cells, m, that limits the number of grid entries."""
    extent = float(np.abs(segments[:, 1] - segments[:, 0]).sum())
    spare = _ENTRIES_PER_WALL * len(segments) + _FREE_ENTRIES
    return max(_MIN_CELL, extent / spare)


def _all_open(positions: Floats) -> NDArray[np.bool_]:
    return np.ones(len(positions), np.bool_)


class Obstacles:
    """The slices of all solid objects above one floor.

    The slices are outlines of surfaces: a footprint between them is free, even inside a
    box.

    Attributes:
        segments: (S, 2, 2) m, x and y of both ends, map frame; lengths are above 0.
        owners: (S,) index of the part that each segment belongs to; 0 if unknown.
        floor: Height of the floor, m.
    """

    def __init__(
        self,
        segments: Floats = NO_SEGMENTS,
        *,
        owners: NDArray[np.intp] | None = None,
        floor: float = 0.0,
    ) -> None:
        lengths = np.hypot(*(segments[:, 1] - segments[:, 0]).T)
        kept = lengths > _MIN_LENGTH
        self.segments = segments[kept]
        known = np.zeros(len(segments), np.intp) if owners is None else owners
        self.owners = known[kept]
        self.floor = floor

    @cached_property
    def walls(self) -> FloorWalls:
        """The segments as the walls of a floor, sorted by cells."""
        return floor_walls(self.segments)

    @cached_property
    def _table(self) -> Packed:
        return pack_walls(*self.walls)

    @classmethod
    def from_scene(cls, scene: Scene, *, floor: float = 0.0) -> "Obstacles":
        """Slice the solid parts of a scene at the bumper heights above a floor."""
        cuts, owners = [], []
        for number, part in enumerate(scene.parts):
            if not part.material.solid:
                continue
            for height in BUMPER_HEIGHTS:
                cut = slice_mesh(part.vertices, part.faces, floor + height)
                cuts.append(cut)
                owners.append(np.full(len(cut), number))
        segments = np.concatenate([NO_SEGMENTS, *cuts])
        none = np.zeros(0, np.intp)
        return cls(segments, owners=np.concatenate([none, *owners]), floor=floor)

    def parts_at(self, footprint: Footprint, pose: Pose2) -> list[int]:
        """Return the indices of the parts whose slices a footprint overlaps, sorted."""
        lines = self._lines_near(pose.x, pose.y, footprint.radius)
        owners = self.owners[lines["rank"].astype(np.intp)]
        place = np.array([[pose.x, pose.y, pose.yaw]], np.float64)
        return [
            number
            for number in np.unique(owners).tolist()
            if footprint.gaps(place, lines[owners == number])[0] <= MARGIN
        ]

    def _lines_near(self, x: float, y: float, distance: float) -> Lines:
        """Return the lines within a distance of a point, in any order."""
        lines = np.zeros(len(self.segments), LINE)
        return lines[: engine.find_walls(self._table, 0, x, y, distance, lines)]

    def clear(
        self, footprint: Footprint, pose: Pose2, others: "Sequence[Robot]" = ()
    ) -> bool:
        """Return whether a footprint overlaps no obstacle and no other robot."""
        place = np.array([[pose.x, pose.y, pose.yaw]], np.float64)
        lines = self._lines_near(pose.x, pose.y, footprint.radius)
        if footprint.gaps(place, lines)[0] <= MARGIN:
            return False
        return not any(overlaps(footprint, pose, other) for other in others)

    def search_free_pose(
        self,
        footprint: Footprint,
        pose: Pose2,
        others: "Callable[[], Sequence[Robot]]" = tuple,
        *,
        within: float = 1.0,
        is_open: Callable[[Floats], NDArray[np.bool_]] = _all_open,
        work: int = 0,
    ) -> Generator[int, None, Pose2 | None]:
        """Find the nearest free pose with the same yaw for a footprint, in steps.

        Args:
            footprint: Footprint to be placed.
            pose: Requested pose. If it is free, the search ends before its first step.
            others: Returns the current robots, which may move between steps.
            within: Radius of the search, m.
            is_open: Returns which of the (N, 2) positions, m, are permitted.
            work: Work of the caller before the search and at the found position. It is
                added to the first step and to each step that may be the last.

        Yields:
            The work of the next step, in comparisons of a position with a line, which
            take about 5 ns each.

        Returns:
            The pose, without any contact, on a search grid of 0.05 m; None if there is
            none. Among positions at equal distance, the first counter-clockwise from
            the map's x axis is returned.
        """
        here = np.array([[pose.x, pose.y]])
        if self.clear(footprint, pose, others()) and is_open(here)[0]:
            return pose
        enlarged = Footprint(
            footprint.length + 2 * _CLEARANCE, footprint.width + 2 * _CLEARANCE
        )
        lines = self._lines_near(pose.x, pose.y, enlarged.radius + within)
        # The nearest lines come first, since they exclude most positions.
        distances = np.hypot(lines["middle_x"] - pose.x, lines["middle_y"] - pose.y)
        lines = lines[np.argsort(distances, kind="stable")]
        yield work + _SORTING_WORK * len(lines)
        for offsets in _search_batches(within):
            places = np.full((len(offsets), 3), pose.yaw, np.float64)
            places[:, :2] = here + offsets
            for first in range(0, len(lines), _LINES):
                some = lines[first : first + _LINES]
                yield len(places) * (_POSITION_WORK + len(some))
                places = places[enlarged.gaps(places, some) > MARGIN]
            at_end = work if len(places) else 0
            yield at_end + _TRACING_WORK + len(places) * _POSITION_WORK
            bodies = others()
            sides = [body.footprint.outline(body.pose) for body in bodies]
            outlines = line_table(np.concatenate([NO_SEGMENTS, *sides]))
            is_free = enlarged.gaps(places, outlines) > MARGIN
            is_free &= is_open(np.ascontiguousarray(places[:, :2]))
            for place in places[is_free].tolist():
                free = Pose2(*place)
                # Another robot may surround the footprint although no side overlaps it.
                if not any(
                    body.footprint.covers(body.pose, free.x, free.y) for body in bodies
                ):
                    return free
        return None


def finish(steps: Generator[int, None, Result]) -> Result:
    """Run a generator to its end, ignoring yielded values, and return its result."""
    try:
        while True:
            next(steps)
    except StopIteration as end:
        result: Result = end.value
        return result


def overlaps(footprint: Footprint, pose: Pose2, other: "Robot") -> bool:
    """Return whether a footprint at a pose overlaps the footprint of a robot."""
    distance = math.hypot(other.pose.x - pose.x, other.pose.y - pose.y)
    if distance > footprint.radius + other.footprint.radius:
        return False
    sides = other.footprint.outline(other.pose)
    # If no side of the other robot overlaps the footprint, the robot is either apart
    # from the footprint or surrounds it.
    place = np.array([[pose.x, pose.y, pose.yaw]], np.float64)
    (gap,) = footprint.gaps(place, line_table(sides)).tolist()
    return gap <= MARGIN or other.footprint.covers(other.pose, pose.x, pose.y)


@cache
def _search_batches(within: float) -> tuple[Floats, ...]:
    """Return batches of positions in rings around (0, 0), innermost first, (N, 2) m."""
    positions = np.array(list(_rings(within))).reshape(-1, 2)
    return tuple(np.split(positions, range(_BATCH, len(positions), _BATCH)))


def _rings(within: float) -> Iterator[tuple[float, float]]:
    for ring in range(1, int(within / _SEARCH_STEP + 1e-9) + 1):
        radius = ring * _SEARCH_STEP
        count = math.ceil(2 * math.pi * ring)
        for k in range(count):
            angle = 2 * math.pi * k / count
            yield radius * math.cos(angle), radius * math.sin(angle)


def enclosed_area(segments: Floats) -> Geometry:
    """Return the area that line segments, (S, 2, 2) m, enclose; see ``area_within``."""
    return area_within(shapely.multilinestrings(np.round(segments, _DIGITS)))


def area_within(lines: Geometry) -> Geometry:
    """Return the area that lines enclose; empty if they enclose nothing.

    A ring inside another ring is a hole. If lines cross, such as the outlines of
    intersecting branches, all enclosed regions belong to the area.
    """
    try:
        return shapely.build_area(lines)
    except shapely.errors.GEOSException:  # lines cross
        return shapely.union_all(shapely.polygonize([shapely.node(lines)]))
