"""Maps of whole drives, against oracles that share no code with map or score.

A map is read from its files, as others read them. The truth is read from the map
file of the scene, and where the robot was from the lines of its server.
"""

import json
import math
import re
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
import shapely
import yaml
from nav_maps import load_nav_map
from numpy.typing import NDArray
from shapely import affinity
from shapely.geometry import Point, Polygon, box

from radarsim.autonomy.evaluation.mapping_run import MappingRun
from radarsim.autonomy.exploration.exploration import Exploration, Outcome
from radarsim.autonomy.mapping.export import nav_map
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.plans import ExplorationPlan
from radarsim.client import Client
from radarsim.geometry import Floats
from radarsim.rng import generator_for
from radarsim.scene.map_file import load_map, shipped_maps
from radarsim.server.host import Host
from radarsim.server.host.lockstep import InProcessTransport
from radarsim.simulation.config import SimulationConfig

pytestmark = pytest.mark.slow

Mask = NDArray[np.bool_]
FollowMode = tuple[tuple[float, float], ...]

SIZE = 0.05  # m, of a cell
HEIGHT = 0.346  # m, of a P3AT's scanner
MOUNT = 0.2085  # m that it is ahead of the robot's middle
DEPTH = 1 / 0.7  # m; depth of a beam of power 1 in foliage of density 0.7
BUSHES, WALLS = "bush", "wall"
BIG = ("bush_1", "bush_3", "bush_6")

ALONG_BUSHES = ((-2.0, -5.0), (-2.0, 5.0))  # 2.5 m before their middles
IN_ROOM = (
    *((-2.5, -5.0), (-2.0, -5.0), (-2.0, 5.0), (-9.0, 5.0), (-9.0, -5.0)),
    *((-2.0, -5.0), (-2.0, 5.0), (-6.0, 0.0), (-4.0, -2.0), (-8.0, 0.0)),
)
ON_MEADOW = (
    *((-8.0, -10.0), (-7.3, -9.0), (-7.3, 9.0), (-14.0, 10.0)),
    *((-14.0, -8.0), (-9.0, -2.0), (-9.0, 1.0)),
)
THROUGH_CLEARING = (
    *((-8.0, -9.0), (-7.5, -13.5), (-2.0, -13.4), (0.5, -9.0), (2.5, -5.0)),
    *((2.8, -1.0), (1.8, 2.0), (1.2, 6.0), (1.2, 11.0), (-2.0, 13.5)),
    *((-7.5, 13.5), (-8.0, 9.0), (-13.0, 3.0)),
)

Robot = tuple[str, tuple[tuple[str, float], ...]]
RADAR: Robot = ("P3AT", ())
RADAR_AROUND: Robot = ("P3AT_Radar360", ())
EXACT_RADAR: Robot = ("P3AT_Radar360", (("side_offset_uu", 0.0),))
HOKUYO: Robot = ("P3AT_Hokuyo", (("max_range", 80.0),))
SICK: Robot = ("P3AT_SICK", ())
RADARS = [
    pytest.param(RADAR, id="half a circle"),
    pytest.param(RADAR_AROUND, id="all around"),
]
LASERS = [pytest.param(HOKUYO, id="Hokuyo"), pytest.param(SICK, id="SICK")]

READING = re.compile(
    rb"SEN {Time ([^}]*)} {Type (INS|GroundTruth)} {Name [^}]*}"
    rb" {Location ([^}]*)} {Orientation ([^}]*)}"
)


class PoseRecorder(InProcessTransport):
    """A connection that records the poses that the server reports."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self.poses: dict[bytes, list[list[float]]] = {b"INS": [], b"GroundTruth": []}

    def receive(self, timeout: float) -> bytes:
        data = super().receive(timeout)
        for line in READING.finditer(data):
            x, y, _ = map(float, line[3].split(b","))
            yaw = float(line[4].split(b",")[2])
            self.poses[line[2]].append([float(line[1]), x, -y, -yaw])
        return data


@dataclass(frozen=True)
class Drive:
    """A finished exploration, and its poses as rows of s, m, m, rad."""

    exploration: Exploration
    truth: Floats
    ins: Floats

    @property
    def mapper(self) -> Mapper:
        assert self.exploration.mapper is not None
        return self.exploration.mapper

    @property
    def estimate(self) -> Floats:
        trajectory = self.mapper.trajectory
        return np.column_stack([trajectory.times, trajectory.rows()])


@cache
def drive(name: str, waypoints: FollowMode, robot: Robot, speed: float) -> Drive:
    class_name, settings = robot
    plan = ExplorationPlan(
        waypoints=waypoints,
        robot_class=class_name,
        speed=speed,
    )
    exploration = Exploration(plan, generator_for(0, "exploring"))
    config = SimulationConfig(item_settings={"lms200": dict(settings)})
    link = PoseRecorder(Host(load_map(name), config=config, seed=1))
    with Client(link) as client:
        exploration.run(client)
    assert exploration.outcome is Outcome.EXPLORED
    poses = {kind: np.array(rows) for kind, rows in link.poses.items()}
    return Drive(exploration, poses[b"GroundTruth"], poses[b"INS"])


def along_bushes(robot: Robot) -> Drive:
    return drive("foliage_room", ALONG_BUSHES, robot, speed=0.4)


@dataclass(frozen=True)
class NavMap:
    """A map as nav2's map_server reads it: 100, 0 or -1, row 0 in the south."""

    cells: NDArray[np.int16]
    origin: tuple[float, float]

    def at(self, x: Floats, y: Floats) -> NDArray[np.int16]:
        """Return the values at places; those beyond the map are unknown."""
        columns = np.floor((x - self.origin[0]) / SIZE).astype(np.int64)
        rows = np.floor((y - self.origin[1]) / SIZE).astype(np.int64)
        height, width = self.cells.shape
        inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        found = np.full(inside.shape, -1, np.int16)
        found[inside] = self.cells[rows[inside], columns[inside]]
        return found


@cache
def nav_of(robot: Robot) -> NavMap:
    cells, head = load_nav_map(nav_map(along_bushes(robot).mapper.grid, "map"))
    assert head["resolution"] == SIZE
    x, y, yaw = head["origin"]
    assert yaw == 0
    return NavMap(cells, (x, y))


def cut(thing: dict[str, Any]) -> Polygon:
    """Return the section of an object of a map file at the scanner's height."""
    x, y, z = thing["position"]
    if "box" in thing:
        half = [side / 2 for side in thing["box"]]
        shape = box(-half[0], -half[1], half[0], half[1])
    else:
        radius = thing["cylinder"][0] if "cylinder" in thing else thing["sphere"]
        if "sphere" in thing:
            radius = math.sqrt(radius**2 - (HEIGHT - z) ** 2)
        shape = Point(0, 0).buffer(radius, 64)
    shape = affinity.rotate(shape, thing.get("yaw_deg", 0), origin=(0, 0))
    return affinity.translate(shape, x, y)


def read_room() -> dict[str, Polygon]:
    """Return the outlines of all objects in the room, by name."""
    text = shipped_maps()["foliage_room"].read_text()
    things = yaml.safe_load(text)["objects"]
    return {one["name"]: cut(one) for one in things if one["name"] != "floor"}


ROOM = read_room()
THINGS = {n: s for n, s in ROOM.items() if not n.startswith(BUSHES) and WALLS not in n}
FOLIAGE = shapely.union_all([s for n, s in ROOM.items() if n.startswith(BUSHES)])
INNER = box(-10.4, -6.4, 10.4, 6.4)
SOLID = shapely.union_all([INNER.exterior, *THINGS.values()])
X, Y = np.meshgrid(np.arange(-11.975, 12, SIZE), np.arange(-7.975, 8, SIZE))


def within(shape: Any) -> Mask:
    shapely.prepare(shape)
    return np.asarray(shapely.contains_xy(shape, X, Y))


@cache
def away(shape: Any) -> Floats:
    """Return the distance of each cell's centre from a shape, m."""
    return np.asarray(shapely.distance(shapely.points(X, Y), shape), np.float64)


def span_of(cells: int) -> float:
    """Return the largest distance of the centre of a cell so many cells away, m."""
    return (cells + 0.5) * SIZE + 1e-9


@cache
def air() -> Mask:
    """Return the empty cells of the room."""
    things = within(shapely.union_all([FOLIAGE, *THINGS.values()]))
    return within(INNER) & ~things


def hidden() -> Mask:
    return np.asarray(air() & (FOLIAGE.bounds[2] < X))


def occupied_near(nav: NavMap, name: str) -> int:
    close = away(ROOM[name].exterior) <= span_of(2)
    return int(np.count_nonzero(close & (nav.at(X, Y) == 100)))


@pytest.mark.parametrize(
    "robot", [*RADARS, pytest.param(EXACT_RADAR, id="N = 0"), *LASERS]
)
def test_robot_drives_along_the_bushes_on_its_side_only(robot: Robot) -> None:
    _, x, y, _ = along_bushes(robot).truth.T
    assert (y.min(), y.max()) == pytest.approx((-5, 5), abs=0.3)
    assert x.max() == pytest.approx(-2, abs=0.2)
    on_the_way = x[np.flatnonzero(y == y.min())[0] :]
    assert on_the_way.min() == pytest.approx(-2, abs=0.5)


@pytest.mark.parametrize("robot", RADARS)
def test_radar_maps_what_is_behind_the_bushes(robot: Robot) -> None:
    nav = nav_of(robot)
    assert np.mean(nav.at(X, Y)[hidden()] != -1) >= 0.6
    for name in THINGS:
        # The pole is four cells wide, behind bushes, and few beams meet it.
        assert occupied_near(nav, name) >= (2 if name == "pole" else 25), name


@pytest.mark.parametrize("robot", LASERS)
def test_laser_maps_nothing_behind_the_bushes(robot: Robot) -> None:
    nav = nav_of(robot)
    assert np.mean(nav.at(X, Y)[hidden()] != -1) < 0.02
    assert sum(occupied_near(nav, name) for name in THINGS) == 0
    before = air() & (FOLIAGE.bounds[0] > X)
    assert np.mean(nav.at(X, Y)[before] != -1) > 0.95


def foliage_between(place: Floats, ends: Floats) -> Floats:
    """Return the length of foliage on straight lines, by chords of circles, (N,) m."""
    lengths = np.hypot(*(ends - place).T)
    directions = (ends - place) / lengths[:, None]
    total = np.zeros(len(ends))
    for name, bush in ROOM.items():
        if name.startswith(BUSHES):
            middle = np.array(bush.centroid.coords[0]) - place
            along = directions @ middle
            half = bush.area / math.pi - (middle @ middle - along**2)
            half = np.sqrt(np.maximum(half, 0))
            near, far = np.clip([along - half, along + half], 0, lengths)
            total += far - near
    return total


def least_foliage(places: Floats, ends: Floats) -> Floats:
    """Return the least foliage before ends on lines past solid objects, (N,) m."""
    solid = shapely.union_all(list(THINGS.values()))
    shapely.prepare(solid)
    least = np.full(len(ends), math.inf)
    for place in places:
        depth = foliage_between(place, ends)
        lines = np.stack([np.broadcast_to(place, ends.shape), ends], axis=1)
        depth[shapely.intersects(shapely.linestrings(lines), solid)] = math.inf
        least = np.minimum(least, depth)
    return least


def test_radar_senses_foliage_exactly_to_the_depth_of_its_power() -> None:
    _, x, y, yaw = along_bushes(EXACT_RADAR).truth[::8].T
    places = np.column_stack([x + MOUNT * np.cos(yaw), y + MOUNT * np.sin(yaw)])
    some = np.zeros(X.shape, np.bool_)
    some[::4, ::4] = True
    some &= within(INNER) & (X > -1) & ~within(shapely.union_all([*THINGS.values()]))
    depth = least_foliage(places, np.column_stack([X[some], Y[some]]))
    sensed = nav_of(EXACT_RADAR).at(X[some], Y[some]) != -1
    in_reach, beyond = depth < DEPTH - 0.1, depth > DEPTH + 0.1
    assert np.count_nonzero(in_reach) > 2500
    assert np.count_nonzero(beyond) > 150
    assert sensed[in_reach].mean() > 0.99
    assert sensed[beyond].mean() < 0.02


@pytest.mark.parametrize("robot", RADARS)
def test_far_sides_of_the_biggest_bushes_are_not_sensed(robot: Robot) -> None:
    unsensed = nav_of(robot).at(X, Y) == -1
    for name in BIG:
        bush = within(ROOM[name])
        assert np.count_nonzero(bush & unsensed) >= 100, name
        assert not (bush & unsensed & (X < 0)).any(), name
        assert X[bush & unsensed].mean() > 1.0, name
    cell_centers = [ROOM[name].centroid for name in BIG]
    places = np.array([(middle.x, middle.y) for middle in cell_centers])
    assert (nav_of(robot).at(*places.T) != -1).all()


@pytest.mark.parametrize(
    ("robot", "cells"),
    [
        pytest.param(EXACT_RADAR, 1, id="N = 0"),
        pytest.param(RADAR, 2, id="N = 25, half a circle"),
        pytest.param(RADAR_AROUND, 2, id="N = 25"),
    ],
)
def test_walls_are_mapped_where_they_are(robot: Robot, cells: int) -> None:
    occupied = nav_of(robot).at(X, Y) == 100
    off = away(INNER.exterior)
    of_walls = occupied & (away(FOLIAGE) > 0.3) & (~within(INNER) | (off < 0.5))
    assert np.mean(off[of_walls] <= span_of(cells)) >= 0.95
    along = np.linspace(0, INNER.exterior.length, 1000)
    walls = shapely.line_interpolate_point(INNER.exterior, along)
    seen = shapely.multipoints(np.column_stack([X[of_walls], Y[of_walls]]))
    assert np.mean(shapely.distance(walls, seen) <= 2.5 * SIZE) > 0.8


@pytest.mark.parametrize("robot", RADARS)
def test_almost_nothing_is_mapped_in_free_air(robot: Robot) -> None:
    found = nav_of(robot).at(X, Y)
    sensed_air = air() & (found != -1)
    off = np.minimum(away(SOLID), away(FOLIAGE))
    false = (found == 100) & air() & (off > span_of(2))
    assert np.count_nonzero(sensed_air) > 80_000
    assert np.count_nonzero(false) / np.count_nonzero(sensed_air) < 0.005


def errors(poses: Floats, truth: Floats) -> tuple[float, float]:
    """Return the root mean square errors of poses, m and degrees."""
    columns = (truth[:, 1], truth[:, 2], np.unwrap(truth[:, 3]))
    true = [np.interp(poses[:, 0], truth[:, 0], column) for column in columns]
    x, y, yaw = poses[:, 1:].T - true
    yaw = np.degrees(np.arctan2(np.sin(yaw), np.cos(yaw)))
    return math.sqrt(np.mean(x**2 + y**2)), math.sqrt(np.mean(yaw**2))


@pytest.mark.parametrize(
    ("name", "waypoints"),
    [
        pytest.param("foliage_room", IN_ROOM, id="in the room"),
        pytest.param("forest_edge", ON_MEADOW, id="on the meadow"),
        pytest.param("forest_edge", THROUGH_CLEARING, id="through the clearing"),
    ],
)
def test_pose_stays_accurate_over_60_m_although_the_ins_drifts(
    name: str, waypoints: FollowMode
) -> None:
    finished = drive(name, waypoints, RADAR, speed=0.6)
    assert np.hypot(*np.diff(finished.truth[:, 1:3], axis=0).T).sum() > 60
    assert finished.estimate[-1, 0] > finished.truth[-1, 0] - 1
    off, turned = errors(finished.estimate, finished.truth)
    assert off < 0.05
    assert turned < 1
    drifted, twisted = errors(finished.ins, finished.truth)
    assert drifted > 0.10
    assert twisted > 1
    run = MappingRun(finished.exploration.plan)
    run.source = finished.exploration
    pose_errors = json.loads(run.to_json())["pose_errors"]
    assert pose_errors["ate"] == pytest.approx(off, abs=0.001)
    assert pose_errors["yaw_deg"] == pytest.approx(turned, abs=0.02)
