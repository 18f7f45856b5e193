"""What robots know of the test map that have driven along its bushes, as counts."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

from radarsim.client import Client
from radarsim.evaluation.ground_truth import GroundTruthMonitor
from radarsim.evaluation.map_score import BESIDE, TOLERANCE, MapScore, score_mapper
from radarsim.exploration.exploration import Exploration, ExplorationPlan
from radarsim.exploration.traversability import Point
from radarsim.figures.foliage_wall import FAR, MAP, bushes_of, things_behind
from radarsim.figures.scan_spec import START, scene_of, start_of
from radarsim.geometry import Floats
from radarsim.host import Host
from radarsim.host.lockstep import InProcessTransport
from radarsim.mapping.occupancy_grid import Mask, OccupancyGrid
from radarsim.mapping.trajectory import Trajectory
from radarsim.presets.robots import Item, load_robot
from radarsim.rng import generator_for
from radarsim.robots.obstacles import slice_parts
from radarsim.scene.scene import Part, Scene
from radarsim.sensors.range_scanner import RangeScanner
from radarsim.simulation.config import SimulationConfig

WAY: Final = ((-2.0, -5.0), (-2.0, 5.0))  # along all bushes, 2.5 m before their middles


@dataclass(frozen=True, slots=True)
class Drive:
    """A way on which a robot makes a map, as anybody can on the command line.

    Attributes:
        robot: Its class.
        seed: Of the simulation.
        settings: Of its scanner, keys and numbers that differ from the class's.
        way: Places to go to in turn, m.
    """

    robot: str
    seed: int
    settings: tuple[tuple[str, float], ...] = ()
    way: tuple[Point, ...] = WAY

    @property
    def command(self) -> str:
        """What makes the same map on the command line."""
        words = [f"radarsim map OUT --serve {MAP} --start {START} --robot {self.robot}"]
        words += [f"--way={x:g},{y:g}" for x, y in self.way]
        name = self._item.name
        words += [f"--set {name}.{key}={value:g}" for key, value in self.settings]
        return " ".join([*words, f"--seed {self.seed}"])

    @property
    def scanner(self) -> RangeScanner:
        """The sensor that maps."""
        return self._config.scanner(self._item)

    @property
    def height(self) -> float:
        """Of the sensor, m, map frame."""
        floor = start_of(scene_of(MAP), START).z
        return floor + load_robot(self.robot).origin_height + self._item.mount.z

    def explore(self) -> "Explored":
        """Drive, and judge what the robot has mapped."""
        scene = scene_of(MAP)
        host = Host(scene, config=self._config, seed=self.seed)
        monitor = GroundTruthMonitor(host)
        plan = ExplorationPlan(waypoints=self.way, robot_class=self.robot, start=START)
        survey = Exploration(plan, generator_for(self.seed, "exploring"))
        with Client(InProcessTransport(host, after_tick=monitor.watch)) as client:
            survey.run(client)
        mapper = survey.mapper
        assert mapper is not None  # or the survey had said why
        assert survey.trip.start is not None
        score = score_mapper(
            mapper, scene, robot_class=self.robot, start=survey.trip.start
        )
        return Explored(
            self, mapper.grid, mapper.trajectory, monitor.path_length, score
        )

    @property
    def _item(self) -> Item:
        return load_robot(self.robot).items_of("RangeScanner")[0]

    @property
    def _config(self) -> SimulationConfig:
        return SimulationConfig(item_settings={self._item.name: dict(self.settings)})


@dataclass(frozen=True, slots=True)
class Explored:
    """What came of a drive.

    Attributes:
        drive: It.
        grid: The map.
        trajectory: Where the robot was, by its own reckoning.
        length: True way, m.
        score: How right the map is.
    """

    drive: Drive
    grid: OccupancyGrid
    trajectory: Trajectory
    length: float
    score: MapScore


@dataclass(frozen=True, slots=True)
class Bush:
    """What a map has of a bush at the sensor's height.

    Attributes:
        name: Of the bush.
        cells: How many it covers.
        blue: How many of these no beam has been in.
        grey: How many of them are free within the short range.
        middle: Whether a beam has been in its middle.
        beyond: How far east of its middle the blue ones are on average, m; nan if
            there are none.
    """

    name: str
    cells: int
    blue: int
    grey: int
    middle: bool
    beyond: float


def radar(seed: int, way: tuple[Point, ...] = WAY) -> Drive:
    """Give the drive on the left of figure 15."""
    return Drive("P3AT_Radar360", seed, (), way)


def hokuyo(seed: int, way: tuple[Point, ...] = WAY) -> Drive:
    """Give the drive on the right of figure 15."""
    return Drive("P3AT_Hokuyo", seed, (("max_range", FAR),), way)


def bushes_in(run: Explored) -> list[Bush]:
    """Tell how much a map has of each bush."""
    scene = scene_of(MAP)
    return [_bush_in(run, scene, part) for part in bushes_of(scene)]


def things_in(run: Explored) -> dict[str, int]:
    """Tell of all that is hidden behind the bushes by how many black cells it shows.

    A cell counts if it is no farther from a thing than a right one may be.
    """
    scene = scene_of(MAP)
    ended, x, y = _laid(run, scene, run.grid.beam_end_cells())
    black = shapely.points(x[ended], y[ended])
    far = (TOLERANCE + BESIDE) * run.grid.frame.resolution
    counts = {}
    for part in things_behind(scene):
        lines = shapely.MultiLineString(list(slice_parts([part], run.drive.height)))
        near = shapely.distance(lines, black) <= far
        counts[part.object_name] = int(np.count_nonzero(near))
    return counts


def _bush_in(run: Explored, scene: Scene, part: Part) -> Bush:
    corners = slice_parts([part], run.drive.height).reshape(-1, 2)
    area = shapely.MultiPoint(corners).convex_hull
    middle = area.centroid
    sensed, x, y = _laid(run, scene, run.grid.sensed_cells())
    near, _, _ = _laid(run, scene, run.grid.short_range_cells())
    covered = np.asarray(shapely.contains_xy(area, x, y))
    blue = covered & ~sensed
    return Bush(
        name=part.object_name,
        cells=int(np.count_nonzero(covered)),
        blue=int(np.count_nonzero(blue)),
        grey=int(np.count_nonzero(covered & near)),
        middle=run.grid.sensed(middle.x, middle.y),
        beyond=float(x[blue].mean() - middle.x) if blue.any() else math.nan,
    )


def _laid(
    run: Explored, scene: Scene, cells: NDArray[np.bool_]
) -> tuple[Mask, Floats, Floats]:
    """Lay cells of a map over the whole scene: they, and the x and y of each, m."""
    (west, south), (east, north) = scene.bounds[:, :2].tolist()
    frame = run.grid.frame.extended_to((west, south), (east, north))
    x, y = np.meshgrid(*frame.cell_centers())
    return run.grid.frame.copy_into(cells, frame), x, y
