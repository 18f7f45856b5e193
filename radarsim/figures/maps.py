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
from radarsim.figures.figure import Plate
from radarsim.figures.foliage_wall import MAP, bushes_of, things_behind
from radarsim.figures.mapping_drives import (
    WAY,
    Bush,
    Explored,
    bushes_in,
    hokuyo,
    radar,
    things_in,
)
from radarsim.figures.scan_spec import START, scene_of
from radarsim.figures.scene_view import draw_robot
from radarsim.geometry import Floats
from radarsim.mapping.export import BLACK, BLUE, GREY, WHITE, commander_png, nav_map
from radarsim.mapping.occupancy_grid import SHORT_RANGE, OccupancyGrid
from radarsim.presets.sensors import load_settings
from radarsim.robots.obstacles import slice_parts

NAMES: Final = ("radar", "Hokuyo")
CORE: Final = 0.01  # share of a bush that is blue at least where a core is told of
_DPI: Final = 110
_CELL: Final = 2  # pixels, so that all cells are as large
_EDGE: Final = 0.2  # m around the room
_WEST, _EAST, _SOUTH, _NORTH, _GAP = 70, 20, 105, 40, 60  # pixels beside the maps
_TEXT: Final = 13.0  # points; the page shows it at half its size
_WAY_COLOUR: Final = "#e31a1c"
_BUSH_COLOUR: Final = "#20b520"
_HALO: Final = withStroke(linewidth=2.5, foreground="white")

Extent = tuple[float, float, float, float]


def draw_maps(seed: int, *, way: tuple[Point, ...] = WAY) -> Plate:
    """Figure 15: what two robots sense that go the same way past the bushes."""
    return plate_of(radar(seed, way).explore(), hokuyo(seed, way).explore())


def plate_of(left: Explored, right: Explored) -> Plate:
    """Put the radar's map and the Hokuyo's beside each other."""
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
    return Plate((drawing,), _caption(*runs), commands)


def placed(grid: OccupancyGrid) -> tuple[Floats, Extent]:
    """Give UsarCommander's picture of a map, and where it belongs.

    Returns:
        Red, green and blue from 0 to 1, (R, C, 3), from the top down; and the x of its
        left and right, the y of its lower and upper edge, m.
    """
    picture = image.imread(io.BytesIO(commander_png(grid)), format="png")
    # what is written for nav2 has the same edges, and says where they are
    told = YAML(typ="safe").load(nav_map(grid, "map")["map.yaml"].decode())
    x, y, _ = told["origin"]
    rows, columns = picture.shape[:2]
    size = grid.frame.resolution
    return picture[:, :, :3], (x, x + columns * size, y, y + rows * size)


def _caption(left: Explored, right: Explored) -> str:
    settings, longest = left.drive.scanner.settings, right.drive.scanner.settings
    hidden = things_behind(scene_of(MAP))
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
        f" {_told_of_bushes(bushes_in(left), bushes_in(right))}"
    )


def _told_of_bushes(left: Sequence[Bush], right: Sequence[Bush]) -> str:
    """Say what of the bushes is blue, and what is grey."""
    foliage = bushes_of(scene_of(MAP))[0].material
    depth = load_settings("radar").penetration_power / foliage.density
    cores = [bush for bush in left if bush.blue > CORE * bush.cells]
    away = [bush.beyond for bush in cores]
    kept = (
        f"; blue cores stay in {_listed([bush.name for bush in cores])},"
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
        f" {len(left)} bushes{kept}. {_share(left, grey)} are grey to it: beams go"
        " there, the robot cannot, as the black tells, where beams end."
    )


def _shown(run: Explored) -> str:
    return _listed([name for name, cells in things_in(run).items() if cells])


def _listed(names: Sequence[str]) -> str:
    *first, last = names or ["none"]
    return f"{', '.join(first)} and {last}" if first else last


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _share(bushes: Sequence[Bush], part: Callable[[Bush], int]) -> str:
    return _percent(sum(map(part, bushes)) / sum(bush.cells for bush in bushes))


def _sheet(resolution: float) -> tuple[Figure, list[Axes]]:
    """Make two panels that show the room, each cell of a map as many pixels."""
    low, high = scene_of(MAP).bounds[:, :2] + [[-_EDGE], [_EDGE]]
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


def _draw_map(axes: Axes, run: Explored) -> None:
    """Draw a map, the way on which it was made, and the true bushes."""
    axes.set_facecolor(_colour(BLUE))  # beyond the map
    picture, extent = placed(run.grid)
    axes.imshow(
        picture, extent=extent, interpolation="nearest", aspect="auto", zorder=1
    )
    low, high = scene_of(MAP).bounds[:, :2] + [[-_EDGE], [_EDGE]]
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    lines = slice_parts(bushes_of(scene_of(MAP)), run.drive.height)
    axes.add_collection(
        LineCollection(list(lines), colors=_BUSH_COLOUR, linewidths=1.0, zorder=2)
    )
    way = run.trajectory.rows()
    style: dict[str, Any] = {
        "color": _WAY_COLOUR,
        "linewidth": 1.2,
        "marker": "o",
        "markersize": 5,
    }
    axes.plot(way[:, 0], way[:, 1], markevery=[0], zorder=3, **style)
    draw_robot(axes, run.drive.robot, run.trajectory.poses[-1], zorder=4)
    _draw_names(axes, run)


def _draw_names(axes: Axes, run: Explored) -> None:
    """Write what is hidden behind the bushes below it, if the map has it."""
    counts = things_in(run)
    for part in things_behind(scene_of(MAP)):
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
        Line2D([], [], color=_WAY_COLOUR, label="way of the robot"),
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
