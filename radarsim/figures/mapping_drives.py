"""Robots that map the test map along its bushes, and what their maps show."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

from radarsim.evaluation.map_score import BESIDE, TOLERANCE, MapScore
from radarsim.evaluation.mapping_run import MappingRun
from radarsim.exploration.exploration import ExplorationPlan
from radarsim.exploration.traversability import Point
from radarsim.figures.foliage_wall import FAR, MAP, bush_parts, hidden_parts
from radarsim.figures.scan_spec import START, find_start_pose, load_scene
from radarsim.geometry import Floats
from radarsim.host import Host
from radarsim.mapping.occupancy_grid import Mask, OccupancyGrid
from radarsim.mapping.trajectory import Trajectory
from radarsim.presets.robots import Item, load_robot
from radarsim.robots.obstacles import slice_parts
from radarsim.scene.scene import Part, Scene
from radarsim.sensors.range_scanner import RangeScanner
from radarsim.simulation.config import SimulationConfig

WAYPOINTS: Final = (
    (-2.0, -5.0),
    (-2.0, 5.0),
)  # along all bushes, 2.5 m before their middles


@dataclass(frozen=True, slots=True)
class MappingDrive:
    """A drive that makes a map; ``command`` repeats it on the command line.

    Attributes:
        robot: Robot class.
        seed: Seed of the simulation.
        settings: Scanner settings that differ from those of the class.
        waypoints: Places to drive to in turn, m, map frame.
    """

    robot: str
    seed: int
    settings: tuple[tuple[str, float], ...] = ()
    waypoints: tuple[Point, ...] = WAYPOINTS

    @property
    def command(self) -> str:
        """Command that makes the same map."""
        words = [f"radarsim map OUT --serve {MAP} --start {START} --robot {self.robot}"]
        words += [f"--way={x:g},{y:g}" for x, y in self.waypoints]
        name = self._item.name
        words += [f"--set {name}.{key}={value:g}" for key, value in self.settings]
        return " ".join([*words, f"--seed {self.seed}"])

    @property
    def scanner(self) -> RangeScanner:
        """The sensor that maps the room."""
        return self._config.scanner(self._item)

    @property
    def height(self) -> float:
        """Height of the sensor, m, map frame."""
        floor = find_start_pose(load_scene(MAP), START).z
        return floor + load_robot(self.robot).origin_height + self._item.mount.z

    def explore(self) -> "MappingResult":
        """Drive, and score the map against the scene."""
        plan = ExplorationPlan(
            waypoints=self.waypoints, robot_class=self.robot, start=START
        )
        host = Host(load_scene(MAP), config=self._config, seed=self.seed)
        run = MappingRun(plan, host, seed=self.seed)
        run.run(("", 0))  # no address, as the server is in this process
        run.judge()
        mapper, monitor, score = run.result.mapper, run.result.monitor, run.result.score
        assert mapper is not None  # or the run had said why
        assert monitor is not None
        assert score is not None
        return MappingResult(
            self, mapper.grid, mapper.trajectory, monitor.path_length, score
        )

    @property
    def _item(self) -> Item:
        return load_robot(self.robot).items_of("RangeScanner")[0]

    @property
    def _config(self) -> SimulationConfig:
        return SimulationConfig(item_settings={self._item.name: dict(self.settings)})


@dataclass(frozen=True, slots=True)
class MappingResult:
    """Result of a drive.

    Attributes:
        drive: The drive.
        grid: The occupancy grid.
        trajectory: Estimated trajectory.
        length: True path length, m.
        score: Score of the map.
    """

    drive: MappingDrive
    grid: OccupancyGrid
    trajectory: Trajectory
    length: float
    score: MapScore


@dataclass(frozen=True, slots=True)
class BushCoverage:
    """Cells of a map that a bush covers at the sensor's height.

    Attributes:
        name: Name of the bush.
        cells: Number of cells that it covers.
        blue: Number of these cells that no beam has crossed.
        grey: Number of these cells that are free within the short range.
        middle: Whether a beam has been in its middle.
        beyond: Mean distance of the blue cells east of the bush's middle, m; nan if
            there are none.
    """

    name: str
    cells: int
    blue: int
    grey: int
    middle: bool
    beyond: float


def radar(seed: int, waypoints: tuple[Point, ...] = WAYPOINTS) -> MappingDrive:
    """Return the drive with the radar, on the left of figure 15."""
    return MappingDrive("P3AT_Radar360", seed, (), waypoints)


def hokuyo(seed: int, waypoints: tuple[Point, ...] = WAYPOINTS) -> MappingDrive:
    """Return the drive with the Hokuyo, on the right of figure 15."""
    return MappingDrive("P3AT_Hokuyo", seed, (("max_range", FAR),), waypoints)


def bush_coverage(run: MappingResult) -> list[BushCoverage]:
    """Return what a map shows of each bush."""
    scene = load_scene(MAP)
    return [_cover_bush(run, scene, part) for part in bush_parts(scene)]


def count_object_cells(run: MappingResult) -> dict[str, int]:
    """Count the black cells of each object behind the bushes.

    A cell counts if it is within the tolerance of the object's outline.
    """
    scene = load_scene(MAP)
    ended, x, y = _aligned_cells(run, scene, run.grid.beam_end_cells())
    black = shapely.points(x[ended], y[ended])
    far = (TOLERANCE + BESIDE) * run.grid.frame.resolution
    counts = {}
    for part in hidden_parts(scene):
        lines = shapely.MultiLineString(list(slice_parts([part], run.drive.height)))
        near = shapely.distance(lines, black) <= far
        counts[part.object_name] = int(np.count_nonzero(near))
    return counts


def _cover_bush(run: MappingResult, scene: Scene, part: Part) -> BushCoverage:
    corners = slice_parts([part], run.drive.height).reshape(-1, 2)
    area = shapely.MultiPoint(corners).convex_hull
    middle = area.centroid
    sensed, x, y = _aligned_cells(run, scene, run.grid.sensed_cells())
    near, _, _ = _aligned_cells(run, scene, run.grid.short_range_cells())
    covered = np.asarray(shapely.contains_xy(area, x, y))
    blue = covered & ~sensed
    return BushCoverage(
        name=part.object_name,
        cells=int(np.count_nonzero(covered)),
        blue=int(np.count_nonzero(blue)),
        grey=int(np.count_nonzero(covered & near)),
        middle=run.grid.sensed(middle.x, middle.y),
        beyond=float(x[blue].mean() - middle.x) if blue.any() else math.nan,
    )


def _aligned_cells(
    run: MappingResult, scene: Scene, cells: NDArray[np.bool_]
) -> tuple[Mask, Floats, Floats]:
    """Return cells of a map on a grid over the whole scene, and the x, y of each."""
    (west, south), (east, north) = scene.bounds[:, :2].tolist()
    frame = run.grid.frame.extended_to((west, south), (east, north))
    x, y = np.meshgrid(*frame.cell_centers())
    return run.grid.frame.copy_into(cells, frame), x, y
