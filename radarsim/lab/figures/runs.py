"""Figures of runs: 13 and 14, Bug1 and Bug2, and 15, maps by a radar and a laser.

Figures 13 and 14 show a run that reaches its goal beside one that finds no path. For
figure 15 robots drive along the bushes of the test map, one with a radar and one with a
Hokuyo; what their maps show is counted.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import shapely

from radarsim.autonomy.evaluation.map_score import BESIDE, TOLERANCE, MapScore
from radarsim.autonomy.evaluation.mapping_run import MappingRun
from radarsim.autonomy.evaluation.navigation_run import NavigationRun
from radarsim.autonomy.evaluation.trials import load_trial
from radarsim.autonomy.exploration.plans import ExplorationPlan
from radarsim.autonomy.mapping.occupancy_grid import Mask, OccupancyGrid
from radarsim.autonomy.mapping.trajectory import Trajectory
from radarsim.autonomy.navigation.algorithms import Algorithm
from radarsim.autonomy.navigation.plans import Mission
from radarsim.autonomy.plotting.maps import MapView, map_figure
from radarsim.autonomy.plotting.outlines import outlines_of
from radarsim.autonomy.plotting.runs import RunView, SteeringSensor, run_figure
from radarsim.geometry import Floats, Point
from radarsim.lab.figures.figure import (
    ROBOT,
    START,
    DrawnFigure,
    find_start_pose,
    load_scene,
)
from radarsim.lab.figures.foliage_wall import FAR, MAP, bush_parts, hidden_parts
from radarsim.plotting.style import as_words, write_at
from radarsim.presets.robots import Item, load_robot
from radarsim.presets.sensors import load_settings
from radarsim.robots.obstacles import slice_parts
from radarsim.scene.scene import Part
from radarsim.sensors.range_scanner import RangeScanner
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig
from radarsim.simulation.map_warnings import plan_height

_TEXT: Final = 13.0  # points; the page shows it at half its size
OPEN: Final = "bug_u_trap"  # a goal that can be reached
CLOSED: Final = "bug_closed_box"  # and one that cannot
_LIMIT: Final = 600.0  # s of simulated time
# How runs end, in details and in titles.
_ENDINGS: Final = {
    "reached": ("goal reached", "reaches its goal"),
    "no_path": ("no path", "finds that there is no path"),
}
# What the algorithms do differently, in captions: leaving, and finding no path.
_CAPTIONS: Final = {
    Algorithm.BUG1: (
        "goes all the way round it, and leaves it where it came nearest (L1)",
        "the wall is between it and the goal even there",
    ),
    Algorithm.BUG2: (
        "goes along it, and leaves it where it is back on the line to the goal, and"
        " nearer (L1)",
        "it comes back to H1 without having crossed that line nearer to the goal",
    ),
}
# Along all bushes, 2.5 m before their middles.
WAYPOINTS: Final = ((-2.0, -5.0), (-2.0, 5.0))
_MIN_CORE: Final = 0.01  # share of cells not sensed from which a bush has a core
_BELOW_WALL: Final = 0.8  # m from the end of the bushes to the name of the yard


def run(map_: str, algorithm: Algorithm, seed: int) -> NavigationRun:
    """Drive a robot towards the goal of a map's trial."""
    scene, trial = load_trial(map_)
    mission = Mission(
        algorithm=algorithm,
        goals=(trial.goal,),
        start=trial.start,
        safety_distance=trial.safety_distance,
        time_limit=_LIMIT,
    )
    driven = NavigationRun(mission, Host(scene, seed=seed))
    driven.execute(("", 0))  # no address, as the server is in this process
    return driven


def draw_bug(seed: int, *, algorithm: Algorithm) -> DrawnFigure:
    """Draw a run that reaches the goal beside one that finds no path."""
    views, endings, touched = [], [], 0
    name = algorithm.value.capitalize()
    for map_ in (OPEN, CLOSED):
        driven = run(map_, algorithm, seed)
        scene, monitor = driven.scene, driven.monitor
        assert scene is not None
        assert monitor is not None  # the server is in this process
        # From the simulation: the robot's own figures drift with its inertial sensor.
        length, off = monitor.path_length, monitor.distance(driven.mission.goals[-1])
        touched += monitor.collisions
        ending, title = _ENDINGS.get(driven.outcome, (driven.outcome, driven.outcome))
        views.append(
            RunView(
                driven.run_log,
                f"{name} {title}, after {length:.1f} m",
                driven.mission.robot_class,
                SteeringSensor("radar", "radar"),
                outlines_of(scene, plan_height(scene)),
                true_path=monitor.positions,
            )
        )
        endings.append(
            f"{ending} after {length:.1f} m, {driven.circuits}"
            f" time{'s' * (driven.circuits != 1)} all round an obstacle, in truth"
            f" {off:.2f} m from the goal"
        )
    leaving, finding = _CAPTIONS[algorithm]
    options = f"--algorithm {algorithm.value} --seed {seed}"
    return DrawnFigure(
        run_figure(views, text=_TEXT),
        f"{name} drives towards the goal until something is in"
        f" the way (H1), {leaving}. At the closed box on the right {finding}, so it"
        " knows that there is no path.",
        tuple(f"radarsim navigate {map_} {options}" for map_ in (OPEN, CLOSED)),
        f"A {ROBOT} drives by the eight bumpers of its radar. On the left:"
        f" {endings[0]}. On the right: {endings[1]}. It touched something"
        f" {touched} times. The coloured path is where the robot believes to be, by its"
        " drifting INS, the dotted one where it truly is. The violet is where its beams"
        " ended, by that belief; the grey walls are the map, which it does not know.",
    )


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
    return [_cover_bush(run, part) for part in bush_parts(load_scene(MAP))]


def count_object_cells(run: MappingResult) -> dict[str, int]:
    """Count the black cells of each object behind the bushes.

    A cell counts if it is within the tolerance of the object's outline.
    """
    ended, x, y = _aligned_cells(run, run.grid.beam_end_cells())
    black = shapely.points(x[ended], y[ended])
    far = (TOLERANCE + BESIDE) * run.grid.frame.resolution
    counts = {}
    for part in hidden_parts(load_scene(MAP)):
        lines = shapely.MultiLineString(list(slice_parts([part], run.drive.height)))
        near = shapely.distance(lines, black) <= far
        counts[part.object_name] = int(np.count_nonzero(near))
    return counts


def _cover_bush(run: MappingResult, part: Part) -> BushCoverage:
    corners = slice_parts([part], run.drive.height).reshape(-1, 2)
    area = shapely.MultiPoint(corners).convex_hull
    middle = area.centroid
    sensed, x, y = _aligned_cells(run, run.grid.sensed_cells())
    near, _, _ = _aligned_cells(run, run.grid.short_range_cells())
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


def _aligned_cells(run: MappingResult, cells: Mask) -> tuple[Mask, Floats, Floats]:
    """Return cells of a map on a grid over the whole scene, and the x, y of each."""
    (west, south), (east, north) = load_scene(MAP).bounds[:, :2].tolist()
    # On one grid over the scene, as a map is only as large as what its robot has seen.
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
    runs, scene = (left, right), load_scene(MAP)
    hidden = hidden_parts(scene)
    shares = [100 * (run.score.hidden_coverage or 0.0) for run in runs]
    views = [
        MapView(
            run.grid,
            run.trajectory.rows(),
            run.drive.robot,
            f"{share:.0f} % of the yard mapped with the {name}",
            outlines_of(scene, run.drive.height),
        )
        for run, share, name in zip(runs, shares, ("radar", "laser"), strict=True)
    ]
    drawing = map_figure(views, text=_TEXT)
    # The bushes, the yard behind them, and the things in it that a map shows.
    corners = np.concatenate([part.vertices for part in bush_parts(scene)])[:, :2]
    (west, south), (east, north) = corners.min(axis=0), corners.max(axis=0)
    yard = (east + scene.bounds[1, 0]) / 2, north - _BELOW_WALL
    shown: list[list[str]] = []
    for axes, run in zip(drawing.axes, runs, strict=True):
        style: Any = {"ha": "center", "fontsize": _TEXT, "zorder": 5}
        middle = (west + east) / 2, (south + north) / 2
        write_at(axes, "bushes", middle, rotation=90, va="center", **style)
        write_at(axes, "the yard behind the bushes", yard, va="center", **style)
        counts = count_object_cells(run)
        seen = [part for part in hidden if counts[part.object_name]]
        shown.append([as_words(part.object_name) for part in seen])
        for part, words in zip(seen, shown[-1], strict=True):
            low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
            place = (low[0] + high[0]) / 2, low[1]
            write_at(axes, words, place, offset=(0, -4), va="top", **style)
    settings, longest = left.drive.scanner.settings, right.drive.scanner.settings
    return DrawnFigure(
        drawing,
        "Two robots drive along a wall of bushes, on this side of it only, and map what"
        " they sense: green is foliage, black is solid, and grey is not sensed."
        f" The radar's map has {shares[0]:.1f} % of the yard behind the bushes and"
        f" {len(shown[0])} of the {len(hidden)} things in it, the"
        f" laser's {shares[1]:.1f} % and {len(shown[1]) or 'none'}.",
        tuple(run.drive.command for run in runs),
        f"From {START} they drive {left.length:.2f} and {right.length:.2f} m: a"
        f" {left.drive.robot} by its radar, N = {settings.side_offset_uu:g}, and a"
        f" {right.drive.robot} by its laser, a Hokuyo, whose own range of"
        f" {load_settings('hokuyo').max_range:g} m is made {longest.max_range:g} m, so"
        " that it is the foliage that stops it. The yard is the floor behind the bushes"
        f" on which a robot would have room; of the {len(hidden)} things there the"
        f" radar's map shows {_join_names(shown[0])}, the laser's"
        f" {_join_names(shown[1])}."
        f" {_describe_bushes(bush_coverage(left), bush_coverage(right))}",
    )


def _describe_bushes(
    left: Sequence[BushCoverage], right: Sequence[BushCoverage]
) -> str:
    """Describe what of the bushes is not sensed, and what counts as near."""
    foliage = bush_parts(load_scene(MAP))[0].material
    depth = load_settings("radar").penetration_power / foliage.density
    cores = [bush for bush in left if bush.blue > _MIN_CORE * bush.cells]
    away = [bush.beyond for bush in cores]
    dark_cores = (
        f"; cores stay grey in {_join_names([as_words(bush.name) for bush in cores])},"
        f" {min(away):.1f} to {max(away):.1f} m beyond their middles, with shadows"
        " behind them"
        if cores
        else ""
    )
    dark, dark_to_laser, near = (
        f"{100 * (sum(counts) / sum(bush.cells for bush in left)):.1f} %"
        for counts in (
            [bush.blue for bush in left],
            [bush.blue for bush in right],
            [bush.grey for bush in left],
        )
    )
    reached = sum(bush.middle for bush in left)
    return (
        f"Of all that is bush {dark} are not sensed by the radar and"
        f" {dark_to_laser} not by the laser. The radar's beams get {depth:.2f} m"
        f" into leaves, from this side past the middles of {reached} of the"
        f" {len(left)} bushes{dark_cores}. In the image of the same map for"
        f" UsarCommander, OUT.png, which knows no foliage, {near} of the"
        " bushes are grey, as if a robot could go there."
    )


def _join_names(names: Sequence[str]) -> str:
    *first, last = names or ["none"]
    return f"{', '.join(first)} and {last}" if first else last
