"""Figure 15: the radar's and the Hokuyo's map of the test map, side by side."""

import io
from collections.abc import Callable, Sequence
from typing import Any, Final

from matplotlib import image
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from ruamel.yaml import YAML

from radarsim.exploration.traversability import Point
from radarsim.figures.figure import DrawnFigure
from radarsim.figures.foliage_wall import MAP, bush_parts, hidden_parts
from radarsim.figures.mapping_drives import (
    WAYPOINTS,
    BushCoverage,
    MappingResult,
    bush_coverage,
    count_object_cells,
    hokuyo,
    radar,
)
from radarsim.figures.scan_spec import START, load_scene
from radarsim.geometry import Floats
from radarsim.mapping.export import BLACK, BLUE, GREY, WHITE, commander_png, nav_map
from radarsim.mapping.occupancy_grid import SHORT_RANGE, OccupancyGrid
from radarsim.plotting.robots import draw_robot
from radarsim.presets.sensors import load_settings
from radarsim.robots.obstacles import slice_parts

NAMES: Final = ("radar", "Hokuyo")
MIN_CORE: Final = 0.01  # share of blue cells from which a bush has a blue core
_DPI: Final = 110
_CELL: Final = 2  # pixels, so that all cells are as large
_EDGE: Final = 0.2  # m around the room
_WEST, _EAST, _SOUTH, _NORTH, _GAP = 70, 20, 105, 40, 60  # pixels beside the maps
_TEXT: Final = 13.0  # points; the page shows it at half its size
_PATH_COLOUR: Final = "#e31a1c"
_BUSH_COLOUR: Final = "#20b520"
_HALO: Final = withStroke(linewidth=2.5, foreground="white")

Extent = tuple[float, float, float, float]


def draw_maps(seed: int, *, waypoints: tuple[Point, ...] = WAYPOINTS) -> DrawnFigure:
    """Draw figure 15: two maps made on the same path along the bushes."""
    return draw_map_pair(
        radar(seed, waypoints).explore(), hokuyo(seed, waypoints).explore()
    )


def draw_map_pair(left: MappingResult, right: MappingResult) -> DrawnFigure:
    """Draw the radar's map and the Hokuyo's side by side."""
    runs = (left, right)
    drawing, panels = _sheet(runs[0].grid.frame.resolution)
    for axes, name, run in zip(panels, NAMES, runs, strict=True):
        reach = run.drive.scanner.settings.max_range
        title = f"{name}: {run.drive.robot}, range {reach:g} m"
        axes.set_title(title, fontsize=_TEXT)
        _draw_map(axes, run)
    panels[0].set_ylabel("y, m", fontsize=_TEXT)
    _legend(drawing)
    commands = tuple(run.drive.command for run in runs)
    return DrawnFigure((drawing,), _caption(*runs), commands)


def commander_image(grid: OccupancyGrid) -> tuple[Floats, Extent]:
    """Return a map in UsarCommander's colours, and its extent.

    Returns:
        RGB image, (R, C, 3) from 0 to 1, top row first; and the x of its left and
        right edge and the y of its lower and upper edge, m, map frame.
    """
    picture = image.imread(io.BytesIO(commander_png(grid)), format="png")
    # the map for nav2 has the same edges, and states its origin
    metadata = YAML(typ="safe").load(nav_map(grid, "map")["map.yaml"].decode())
    x, y, _ = metadata["origin"]
    rows, columns = picture.shape[:2]
    size = grid.frame.resolution
    return picture[:, :, :3], (x, x + columns * size, y, y + rows * size)


def _caption(left: MappingResult, right: MappingResult) -> str:
    settings, longest = left.drive.scanner.settings, right.drive.scanner.settings
    hidden = hidden_parts(load_scene(MAP))
    shares = [_percent(run.score.hidden_coverage or 0.0) for run in (left, right)]
    return (
        f"Two robots go from {START} along the bushes, on this side of them only,"
        f" {left.length:.2f} and {right.length:.2f} m, and map what they sense: a"
        f" {left.drive.robot} by its radar, N = {settings.side_offset_uu:g}, and a"
        f" {right.drive.robot} by the Hokuyo, whose own range of"
        f" {load_settings('hokuyo').max_range:g} m is made {longest.max_range:g} m, so"
        " that it is the foliage that stops it. Of the floor behind the bushes on which"
        f" a robot would have room, {shares[0]} are sensed by the radar and {shares[1]}"
        f" by the Hokuyo; of the {len(hidden)} things there the radar's map shows"
        f" {_shown(left)}, the Hokuyo's {_shown(right)}."
        f" {_describe_bushes(bush_coverage(left), bush_coverage(right))}"
    )


def _describe_bushes(
    left: Sequence[BushCoverage], right: Sequence[BushCoverage]
) -> str:
    """Describe the blue and the grey cells of the bushes."""
    foliage = bush_parts(load_scene(MAP))[0].material
    depth = load_settings("radar").penetration_power / foliage.density
    cores = [bush for bush in left if bush.blue > MIN_CORE * bush.cells]
    away = [bush.beyond for bush in cores]
    blue_cores = (
        f"; blue cores stay in {_join_names([bush.name for bush in cores])},"
        f" {min(away):.1f} to {max(away):.1f} m beyond their middles, with blue shadows"
        if cores
        else ""
    )
    blue, grey = (lambda one: one.blue), (lambda one: one.grey)
    reached = sum(bush.middle for bush in left)
    return (
        f"Of all that is bush {_share(left, blue)} are blue to the radar and"
        f" {_share(right, blue)} to the Hokuyo. The radar's beams get {depth:.2f} m"
        f" into leaves, from this side past the middles of {reached} of the"
        f" {len(left)} bushes{blue_cores}. {_share(left, grey)} are grey to it: beams"
        " go there, the robot cannot, as the black tells, where beams end."
    )


def _shown(run: MappingResult) -> str:
    return _join_names(
        [name for name, cells in count_object_cells(run).items() if cells]
    )


def _join_names(names: Sequence[str]) -> str:
    *first, last = names or ["none"]
    return f"{', '.join(first)} and {last}" if first else last


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _share(bushes: Sequence[BushCoverage], part: Callable[[BushCoverage], int]) -> str:
    return _percent(sum(map(part, bushes)) / sum(bush.cells for bush in bushes))


def _sheet(resolution: float) -> tuple[Figure, list[Axes]]:
    """Create two panels that show the room, with a whole number of pixels a cell."""
    low, high = load_scene(MAP).bounds[:, :2] + [[-_EDGE], [_EDGE]]
    across, up = (round(float(m) / resolution) * _CELL for m in high - low)
    width, height = _WEST + 2 * across + _GAP + _EAST, _SOUTH + up + _NORTH
    drawing = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI)
    panels = []
    for left in (_WEST, _WEST + across + _GAP):
        place = (left / width, _SOUTH / height, across / width, up / height)
        axes = drawing.add_axes(place)
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.set_xlabel("x, m", fontsize=_TEXT)
        axes.tick_params(labelsize=_TEXT)
        panels.append(axes)
    return drawing, panels


def _draw_map(axes: Axes, run: MappingResult) -> None:
    """Draw a map, the path of the robot and the true outlines of the bushes."""
    axes.set_facecolor(_colour(BLUE))  # beyond the map
    picture, extent = commander_image(run.grid)
    axes.imshow(
        picture, extent=extent, interpolation="nearest", aspect="auto", zorder=1
    )
    low, high = load_scene(MAP).bounds[:, :2] + [[-_EDGE], [_EDGE]]
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    lines = slice_parts(bush_parts(load_scene(MAP)), run.drive.height)
    axes.add_collection(
        LineCollection(list(lines), colors=_BUSH_COLOUR, linewidths=1.0, zorder=2)
    )
    path = run.trajectory.rows()
    style: dict[str, Any] = {
        "color": _PATH_COLOUR,
        "linewidth": 1.2,
        "marker": "o",
        "markersize": 5,
    }
    axes.plot(path[:, 0], path[:, 1], markevery=[0], zorder=3, **style)
    draw_robot(axes, run.drive.robot, run.trajectory.poses[-1], zorder=4)
    _draw_names(axes, run)


def _draw_names(axes: Axes, run: MappingResult) -> None:
    """Label the hidden objects that the map shows."""
    counts = count_object_cells(run)
    for part in hidden_parts(load_scene(MAP)):
        if counts[part.object_name]:
            low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
            axes.annotate(
                part.object_name,
                (float(low[0] + high[0]) / 2, float(low[1])),
                xytext=(0, -4),
                textcoords="offset points",
                ha="center",
                va="top",
                fontsize=_TEXT,
                path_effects=[_HALO],
                zorder=5,
            )


def _legend(drawing: Figure) -> None:
    names = {
        BLUE: "no beam has been there",
        WHITE: "a beam has",
        GREY: f"free within {SHORT_RANGE:g} m",
        BLACK: "beams end",
    }
    samples: list[Patch | Line2D] = [
        Patch(facecolor=_colour(shade), edgecolor="0.5", label=name)
        for shade, name in names.items()
    ]
    samples += [
        Line2D([], [], color=_PATH_COLOUR, label="path of the robot"),
        Line2D([], [], color=_BUSH_COLOUR, label="bushes, in truth"),
    ]
    drawing.legend(
        handles=samples,
        loc="lower center",
        ncols=len(samples),
        fontsize=_TEXT,
        frameon=False,
    )


def _colour(shade: tuple[int, int, int]) -> tuple[float, float, float]:
    red, green, blue = shade
    return red / 255, green / 255, blue / 255
