"""Figure 15: the radar's and the Hokuyo's map of the test map, side by side."""

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes

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
from radarsim.plotting.annotations import HALO, as_words
from radarsim.plotting.maps import MapView, map_figure
from radarsim.plotting.outlines import outlines_of
from radarsim.presets.sensors import load_settings

NAMES: Final = ("radar", "laser")
MIN_CORE: Final = 0.01  # share of cells not sensed from which a bush has a core
_TEXT: Final = 13.0  # points; the page shows it at half its size
_BELOW_WALL: Final = 0.8  # m from the end of the bushes to the name of the yard


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
