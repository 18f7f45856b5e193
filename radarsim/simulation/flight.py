"""Vertical motion of flying robots, and the obstacles around these robots.

Horizontally, a flying robot moves like a driving robot, among slices of all solid
objects at the heights of its body. Slices are computed when a robot enters a height
band of ``BAND`` m and a tile of the map, and dropped when it leaves. A robot rises or
descends until vertical rays from its body hit a surface that stops robots or light, or
its footprint overlaps the slices of the next band.
"""

import math
from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np

from radarsim.engine import engine
from radarsim.geometry import Floats, Pose3
from radarsim.presets.robots import RobotModel
from radarsim.raycast.rays import Boxes
from radarsim.raycast.tracer import Tracer
from radarsim.robots.fleet import WALL_RANGE, Fleet
from radarsim.robots.obstacles import Obstacles, slice_mesh
from radarsim.robots.robot import UNKNOWN, Robot
from radarsim.scene.scene import Part, Scene
from radarsim.scene.shapes import Faces, Mesh, concatenate
from radarsim.sensors.sensor import sight_rays
from radarsim.simulation.clock import TICK

BAND: Final = 0.1  # m; height of a band
TILE: Final = 1.0  # m; side of a tile
HEADROOM: Final = 20.0  # m; flight ceiling above the highest point of the map
INSET: Final = 0.01  # m from the sides of a robot to its outer rays
_LOOK_AHEAD: Final = 4  # ticks between two computations of the next band
_SIDES: Final = (-1.0, 0.0, 1.0)
# Start points of vertical rays, as multiples of half the robot's length and width.
_GRID: Final = np.array([(x, y, 0.0) for x in _SIDES for y in _SIDES])


_BLOCK: Final = 32  # triangles per block of the index
_CELL: Final = np.array([0.5, 0.5, 0.2])  # m; size of a cell of the index
_NOTHING: Final[Mesh] = (np.zeros((0, 3)), np.zeros((0, 3), np.int32))


Area: TypeAlias = tuple[float, float, float, float]


class Surroundings(NamedTuple):
    """The obstacles near a flying robot, in one tile of the map and one height band.

    Attributes:
        tile: Column and row of the tile, which is ``TILE`` m wide.
        band: Number of the band, which is ``BAND`` m high.
        slices: The slices, each at half the height of a band, by number of the band.
        obstacles: The obstacles of all slices.
    """

    tile: tuple[int, int]
    band: int
    slices: dict[int, Floats]
    obstacles: Obstacles


class Airspace:
    """The obstacles of a scene at all heights, for flying robots.

    Attributes:
        ceiling: Height above which no robot rises, m.
    """

    def __init__(self, scene: Scene, tracer: Tracer) -> None:
        self._tracer = tracer
        self._top = float(scene.bounds[1, 2])
        self.ceiling = self._top + HEADROOM
        self._mesh = SolidMesh(scene.parts)
        self._ticks = 0
        # The current surroundings of each robot. Surroundings at a height that the
        # robot has left or could not reach may follow them.
        self._around: WeakKeyDictionary[Robot, tuple[Surroundings, ...]]
        self._around = WeakKeyDictionary()

    def surroundings(
        self,
        model: RobotModel,
        place: tuple[float, float, float],
        reach: float,
        known: tuple[Surroundings, ...] = (),
    ) -> Surroundings:
        """Return the obstacles around a robot at a position.

        Args:
            model: Robot class.
            place: x, y and z of the body frame, m, map frame.
            reach: Distance around the tile within which obstacles are included, m.
            known: Surroundings that were computed earlier, the latest first.

        Returns:
            The entry of ``known`` for the robot's tile and band, or new surroundings.
        """
        x, y, z = place
        tile = math.floor(x / TILE), math.floor(y / TILE)
        # All height bands above the highest object are empty, so they share a number.
        bottom = min(z - model.origin_height, self._top + BAND)
        band = math.floor(bottom / BAND + 1e-9)
        for each in known:
            if each.tile == tile and each.band == band:
                return each
        left, lower = tile[0] * TILE - reach, tile[1] * TILE - reach
        width = TILE + 2 * reach
        area = left, left + width, lower, lower + width
        numbers = range(band, band + math.ceil(model.height / BAND) + 1)
        old = known[0].slices if known and known[0].tile == tile else {}
        heights = {n: (n + 0.5) * BAND for n in numbers if n not in old}
        faces = self._mesh.near(area, *heights.values()) if heights else _NOTHING[1]
        cuts = old | {
            number: slice_mesh(self._mesh.vertices, faces, height)
            for number, height in heights.items()
        }
        slices = {number: cuts[number] for number in numbers}
        walls = np.concatenate([*slices.values()])
        (x, y), (other_x, other_y) = walls[:, 0].T, walls[:, 1].T
        is_near = (np.minimum(x, other_x) <= area[1]) & (np.maximum(x, other_x) >= left)
        is_near &= np.minimum(y, other_y) <= area[3]
        is_near &= np.maximum(y, other_y) >= lower
        obstacles = Obstacles(walls[is_near], floor=band * BAND)
        return Surroundings(tile, band, slices, obstacles)

    def lift(self, fleet: Fleet, robot: Robot, z: float, *known: Surroundings) -> None:
        """Move a robot to a height, m, and update the obstacles around it."""
        around = self._around_robot(robot, z, *known)
        self._around[robot] = (around,)
        fleet.lift(robot, z, around.obstacles)

    def climb(self, fleet: Fleet, robot: Robot, room: float | None, dt: float) -> None:
        """Move a robot up or down for one time step, as far as it finds free space.

        Args:
            fleet: The fleet of the robot.
            robot: A flying robot.
            room: Free distance above or below the robot, m, from ``rooms``; None if it
                neither rises nor descends.
            dt: Time step, s.
        """
        row = robot.row
        x, y, z = robot.body.numbers()[:3]
        if room is not None:
            self._climb(fleet, robot, room, float(row["climb"]) * dt)
            row["velocity_z"] = (row["body_z"] - z) / dt
            return
        row["velocity_z"] = 0.0
        tile = math.floor(x / TILE), math.floor(y / TILE)
        if self._around[robot][0].tile != tile:
            self.lift(fleet, robot, z)

    def _climb(self, fleet: Fleet, robot: Robot, room: float, wanted: float) -> None:
        """Move a robot up by ``wanted`` m, or down if below 0, as far as possible."""
        row = robot.row
        z = float(row["body_z"])
        room = min(room, self.ceiling - z)
        target = z + math.copysign(max(0.0, min(abs(wanted), room)), wanted)
        here = self._around_robot(robot, z)
        around = beyond = self._around_robot(robot, target, here)
        if around is not here and not around.obstacles.clear(
            robot.footprint, robot.pose
        ):
            around, target = here, z
        elif (robot.number + self._ticks) % _LOOK_AHEAD == 0:
            # The next band is computed before the robot enters it, in different ticks
            # for different robots, so that a tick with many rising robots stays short.
            next_z = target + math.copysign(BAND, wanted)
            beyond = self._around_robot(robot, next_z, around)
        others = (beyond, here, *self._around[robot])
        other = next((each for each in others if each is not around), around)
        self._around[robot] = around, other
        row["touched"] = UNKNOWN
        row["blocked"] = row["blocked"] or abs(target - z) < abs(wanted) - 1e-9
        fleet.lift(robot, target, around.obstacles)

    def rooms(
        self, fleet: Fleet, robots: Iterable[Robot], boxes: Boxes, dt: float
    ) -> dict[Robot, float]:
        """Return how far, m, each robot that rises or descends in this tick can move.

        Args:
            fleet: The fleet of the robots.
            robots: Flying robots.
            boxes: Boxes of all robots.
            dt: Time step, s.
        """
        self._ticks += 1
        robots = [robot for robot in robots if robot.row["climb"]]
        if not robots:
            return {}
        rows = fleet.table[[robot.slot for robot in robots]]
        signs = np.copysign(1.0, rows["climb"])
        heights = np.array(
            [
                robot.model.height - robot.model.origin_height
                if sign > 0
                else robot.model.origin_height
                for robot, sign in zip(robots, signs, strict=True)
            ]
        )
        count = len(_GRID)
        starts = np.concatenate([_ray_starts(robot) for robot in robots])
        directions = np.zeros((len(starts), 3))
        directions[:, 2] = np.repeat(signs, count)
        reach = np.repeat(heights + np.abs(rows["climb"] * dt), count)
        numbers = np.repeat(rows["number"].astype(np.int64), count)
        rays = sight_rays(starts, directions, reach, numbers)
        ranges = self._tracer.trace(rays, boxes).ranges.reshape(-1, count)
        rooms = ranges.min(axis=1) - heights
        return dict(zip(robots, rooms.tolist(), strict=True))

    def _around_robot(
        self, robot: Robot, z: float, *known: Surroundings
    ) -> Surroundings:
        """Return the obstacles around a robot at a height, m; see ``surroundings``."""
        pose, radius = robot.pose, robot.footprint.radius
        reach = radius + WALL_RANGE + robot.top_speed * TICK
        known += self._around.get(robot, ())
        return self.surroundings(robot.model, (pose.x, pose.y, z), reach, known)


class SolidMesh:
    """An index of the triangles of all solid parts, to slice small areas quickly.

    Triangles are sorted by spatial cells and divided into blocks of equal size. Only
    the triangles of blocks whose bounds reach into the area are sliced, so the time
    hardly depends on the size of the map.

    Attributes:
        vertices: (V, 3) m, map frame.
    """

    def __init__(self, parts: Iterable[Part]) -> None:
        """Build the index of the triangles of all solid parts."""
        solid = [(p.vertices, p.faces) for p in parts if p.material.solid]
        self.vertices, self._faces = map(
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
        self._found = np.zeros(self._lows.shape[1], np.int64)  # output of `find_boxes`

    def near(self, area: Area, *heights: float) -> Faces:
        """Return the triangles in an area and a height range, and maybe some near it.

        Args:
            area: Smallest and largest x, smallest and largest y, m, map frame.
            heights: One or more values of z, m, map frame.

        Returns:
            (F, 3) vertex indices, in the order of the parts and of their faces.
        """
        found, levels = self._found, (min(heights), max(heights))
        count = engine.find_boxes(self._lows, self._highs, *area, *levels, found)
        blocks = found[:count]
        places = (blocks[:, None] * _BLOCK + np.arange(_BLOCK)).ravel()
        numbers = np.sort(self._order[places[places < len(self._order)]])
        faces: Faces = self._faces[numbers]
        return faces

    def _bounds(self, faces: Faces) -> tuple[Floats, Floats]:
        """Return the least and the greatest coordinates of each triangle, (N, 3) m."""
        a, b, c = (self.vertices[corners] for corners in faces.T)
        return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _chunks(count: int) -> Iterator[slice]:
    """Yield slices of triangle numbers, since all bounds at once need much memory."""
    size = 4096 * _BLOCK
    return (slice(first, first + size) for first in range(0, count, size))


def _ray_starts(robot: Robot) -> Floats:
    """Return the origins, (9, 3) m, map frame, of the vertical rays of a robot."""
    model, body = robot.model, robot.body
    level = Pose3(body.x, body.y, body.z, yaw=body.yaw)  # The box is never tilted.
    half = (model.length / 2 - INSET, model.width / 2 - INSET, 0.0)
    starts: Floats = (_GRID * half) @ level.rotation().T + level.position()
    return starts
