"""Figure 15: the radar's and the Hokuyo's map of the test map, side by side.

Robots drive along the bushes of that map; what their maps show is counted.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import shapely
from matplotlib.axes import Axes
from numpy.typing import NDArray

from radarsim.autonomy.evaluation.map_score import BESIDE, TOLERANCE, MapScore
from radarsim.autonomy.evaluation.mapping_run import MappingRun
from radarsim.autonomy.exploration.plans import ExplorationPlan
from radarsim.autonomy.mapping.occupancy_grid import Mask, OccupancyGrid
from radarsim.autonomy.mapping.trajectory import Trajectory
from radarsim.autonomy.plotting.maps import MapView, map_figure
from radarsim.autonomy.plotting.outlines import outlines_of
from radarsim.geometry import Floats, Point
from radarsim.lab.figures.figure import START, DrawnFigure, find_start_pose, load_scene
from radarsim.lab.figures.foliage_wall import FAR, MAP, bush_parts, hidden_parts
from radarsim.plotting.annotations import HALO, as_words
from radarsim.presets.robots import Item, load_robot
from radarsim.presets.sensors import load_settings
from radarsim.robots.obstacles import slice_parts
from radarsim.scene.scene import Part, Scene
from radarsim.sensors.range_scanner import RangeScanner
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

WAYPOINTS: Final = (
    (-2.0, -5.0),
    (-2.0, 5.0),
)  # along all bushes, 2.5 m before their middles
NAMES: Final = ("radar", "laser")
MIN_CORE: Final = 0.01  # share of cells not sensed from which a bush has a core
_TEXT: Final = 13.0  # points; the page shows it at half its size
_BELOW_WALL: Final = 0.8  # m from the end of the bushes to the name of the yard


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
        words = [f"radarsim map {MAP} -o OUT --start {START} --robot {self.robot}"]
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


def draw_maps(seed: int, *, waypoints: tuple[Point, ...] = WAYPOINTS) -> DrawnFigure:
    """Draw figure 15: two maps made on the same path along the bushes."""
    return draw_map_pair(
        radar(seed, waypoints).explore(), hokuyo(seed, waypoints).explore()
    )


def draw_map_pair(left: MappingResult, right: MappingResult) -> DrawnFigure:
    """Draw the radar's map and the Hokuyo's side by side."""
    runs = (left, right)
    views = [_view(run, name) for run, name in zip(runs, NAMES, strict=True)]
    drawing = map_figure(views, text=_TEXT)
    for axes, run in zip(drawing.axes, runs, strict=True):
        _draw_names(axes, run)
    commands = tuple(run.drive.command for run in runs)
    return DrawnFigure((drawing,), _caption(*runs), commands, _details(*runs))


def _view(run: MappingResult, name: str) -> MapView:
    share = run.score.hidden_coverage or 0.0
    return MapView(
        run.grid,
        run.trajectory.rows(),
        run.drive.robot,
        f"{100 * share:.0f} % of the yard mapped with the {name}",
        outlines_of(load_scene(MAP), run.drive.height),
    )


def _caption(left: MappingResult, right: MappingResult) -> str:
    things = [len(_shown(run)) for run in (left, right)]
    shares = [run.score.hidden_coverage or 0.0 for run in (left, right)]
    return (
        "Two robots drive along a wall of bushes, on this side of it only, and map what"
        " they sense: green is foliage, black is solid, and grey is not sensed."
        f" The radar's map has {_percent(shares[0])} of the yard behind the bushes and"
        f" {things[0]} of the {len(hidden_parts(load_scene(MAP)))} things in it, the"
        f" laser's {_percent(shares[1])} and {things[1] or 'none'}."
    )


def _details(left: MappingResult, right: MappingResult) -> str:
    settings, longest = left.drive.scanner.settings, right.drive.scanner.settings
    hidden = hidden_parts(load_scene(MAP))
    return (
        f"From {START} they drive {left.length:.2f} and {right.length:.2f} m: a"
        f" {left.drive.robot} by its radar, N = {settings.side_offset_uu:g}, and a"
        f" {right.drive.robot} by its laser, a Hokuyo, whose own range of"
        f" {load_settings('hokuyo').max_range:g} m is made {longest.max_range:g} m, so"
        " that it is the foliage that stops it. The yard is the floor behind the bushes"
        f" on which a robot would have room; of the {len(hidden)} things there the"
        f" radar's map shows {_join_names(_shown(left))}, the laser's"
        f" {_join_names(_shown(right))}."
        f" {_describe_bushes(bush_coverage(left), bush_coverage(right))}"
    )


def _describe_bushes(
    left: Sequence[BushCoverage], right: Sequence[BushCoverage]
) -> str:
    """Describe what of the bushes is not sensed, and what counts as near."""
    foliage = bush_parts(load_scene(MAP))[0].material
    depth = load_settings("radar").penetration_power / foliage.density
    cores = [bush for bush in left if bush.blue > MIN_CORE * bush.cells]
    away = [bush.beyond for bush in cores]
    dark_cores = (
        f"; cores stay dark in {_join_names([as_words(bush.name) for bush in cores])},"
        f" {min(away):.1f} to {max(away):.1f} m beyond their middles, with shadows"
        " behind them"
        if cores
        else ""
    )
    dark, near = (lambda one: one.blue), (lambda one: one.grey)
    reached = sum(bush.middle for bush in left)
    return (
        f"Of all that is bush {_share(left, dark)} are not sensed by the radar and"
        f" {_share(right, dark)} not by the laser. The radar's beams get {depth:.2f} m"
        f" into leaves, from this side past the middles of {reached} of the"
        f" {len(left)} bushes{dark_cores}. In the image of the same map for"
        f" UsarCommander, OUT.png, which knows no foliage, {_share(left, near)} of the"
        " bushes are grey, as if a robot could go there."
    )


def _shown(run: MappingResult) -> list[str]:
    """Return the names of the hidden things that a map shows."""
    counts = count_object_cells(run)
    return [as_words(name) for name, cells in counts.items() if cells]


def _join_names(names: Sequence[str]) -> str:
    *first, last = names or ["none"]
    return f"{', '.join(first)} and {last}" if first else last


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _share(bushes: Sequence[BushCoverage], part: Callable[[BushCoverage], int]) -> str:
    return _percent(sum(map(part, bushes)) / sum(bush.cells for bush in bushes))


def _draw_names(axes: Axes, run: MappingResult) -> None:
    """Label the bushes, the yard behind them, and the things in it that a map shows."""
    counts, scene = count_object_cells(run), load_scene(MAP)
    corners = np.concatenate([part.vertices for part in bush_parts(scene)])[:, :2]
    (west, south), (east, north) = corners.min(axis=0), corners.max(axis=0)
    _write(axes, "bushes", (west + east) / 2, (south + north) / 2, rotation=90)
    middle = (east + scene.bounds[1, 0]) / 2
    _write(axes, "the yard behind the bushes", middle, north - _BELOW_WALL)
    for part in hidden_parts(scene):
        if counts[part.object_name]:
            low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
            place = (low[0] + high[0]) / 2, low[1]
            _write(axes, as_words(part.object_name), *place, up=-4, va="top")


def _write(
    axes: Axes, text: str, x: float, y: float, *, up: float = 0.0, **style: Any
) -> None:
    """Write a text at a place, m, or some points above it."""
    style = {"ha": "center", "va": "center", **style}
    axes.annotate(
        text,
        (float(x), float(y)),
        xytext=(0, up),
        textcoords="offset points",
        fontsize=_TEXT,
        path_effects=[HALO],
        zorder=5,
        **style,
    )
