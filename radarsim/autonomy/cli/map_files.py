"""The files of ``radarsim map``: cells, trajectory, pictures, and frames of films."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click
import numpy as np

from radarsim.autonomy.cli.film import check_film, drawn_robot
from radarsim.autonomy.evaluation.map_score import FloorPart
from radarsim.autonomy.evaluation.mapping_run import MappingResult
from radarsim.autonomy.exploration.exploration import Exploration
from radarsim.autonomy.mapping.export import (
    HEAD,
    commander_png,
    is_radarsim_map,
    nav_map,
)
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.mapping.trajectory import tum_text
from radarsim.autonomy.plotting.maps import (
    MapFrames,
    MapView,
    draw_area_curve,
    draw_map_view,
    first_map_extent,
)
from radarsim.autonomy.plotting.outlines import Outline, outlines_of
from radarsim.autonomy.watching import WatchMapper
from radarsim.cli.output import (
    check_picture,
    check_writable,
    print_message,
    write_picture,
)
from radarsim.errors import describe_os_error
from radarsim.files import is_by_radarsim, write_atomically
from radarsim.plotting.film import Pixels
from radarsim.plotting.style import as_words

if TYPE_CHECKING:
    from radarsim.autonomy.cli.map import MapFileOptions

DEFAULT_STEM: Final = "map"  # of the names of files in a folder
FILE_SUFFIXES: Final = (".png", ".pgm", ".yaml", ".tum")
TITLE_ENDINGS: Final = {
    "incomplete": "until nothing was left to try",
    "time_limit": "until time was up",
    "stuck": "until the robot was stuck",
    "failed": "until the run failed",
    "broken_off": "until interrupted",
}


class MapFiles:
    """The files of a map.

    Attributes:
        options: What is written.
        stem: The path that the names of all files begin with.
        paths: All files: cells, nav2's image and YAML, trajectory, picture.
    """

    def __init__(self, options: MapFileOptions, name: str) -> None:
        """Choose the names.

        Args:
            options: What is written. A folder, or what the names of the files begin
                with; the suffix of one of the files may follow.
            name: What they begin with by default.
        """
        self.options = options
        out = options.output or name
        path = Path(out)
        self._names_folder = is_folder = out.endswith(("/", os.sep))
        with suppress(OSError):  # as of a name that is too long
            is_folder = is_folder or path.is_dir()
        if is_folder:
            path /= DEFAULT_STEM
        elif path.suffix in FILE_SUFFIXES:
            path = path.with_suffix("")
        self.stem = path
        scale, image = ("_scale", ".png") if options.mode == "scale" else ("", ".pgm")
        endings = (".png", f"{scale}{image}", f"{scale}.yaml", ".tum", "_view.png")
        self.paths = tuple(path.with_name(path.name + each) for each in endings)

    def check(self, served: str | None = None) -> None:
        """Check before the robot drives that the files can be written after it.

        A missing folder is created if its name ends in a slash.

        Args:
            served: The map that is simulated, or None.

        Raises:
            click.BadParameter: If the folder is missing or not writable, or a file of
                another program would be overwritten.
        """
        folder = self.stem.parent
        try:
            if self._names_folder:
                folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            text = f"cannot make {folder}: {describe_os_error(error)}"
            raise click.BadParameter(text, param_hint="OUT") from None
        for path in self.paths:
            check_writable(path, "OUT")
            if path.is_file() and not _may_be_replaced(path, served):
                is_served = _is_same(path, served)
                what = "the simulated map" if is_served else "of another program"
                text = f"would overwrite {path}, which is {what}, expected -o OUT"
                raise click.BadParameter(text, param_hint="-o")
        check_film(self.options.film)
        check_picture(self.options.plot)

    def write(self, result: MappingResult) -> None:
        """Write the map of a run, and the plot, if there was a scan.

        Why the map cannot be written is noted in the result, and on stderr.
        """
        mapper = result.mapper
        if mapper is None or not mapper.scans:
            return
        grid, paths = mapper.grid, self.paths
        image, yaml = nav_map(grid, paths[2].stem, mode=self.options.mode).values()
        contents = (
            commander_png(grid),
            image,
            yaml,
            tum_text(mapper.trajectory).encode(),
            draw_map_view(view_of(result, mapper)),
        )
        try:
            # all or none: old and new files never stand side by side
            write_atomically(dict(zip(paths, contents, strict=True)))
            result.files = paths
        except OSError as error:
            name = "the map" if error.filename is None else error.filename
            text = f"cannot write {name}: {describe_os_error(error)}"
            print_message(text)
            result.error = f"{result.error}; {text}" if result.error else text
        plot, curve = self.options.plot, result.area_curve
        if plot is not None and curve.samples:
            name = "" if result.scene is None else f" in {as_words(result.scene.name)}"
            strategy, title = result.strategy or "", f"Known area{name}"
            form = check_picture(plot)
            write_picture(plot, draw_area_curve(curve, strategy, title, form))


def _may_be_replaced(path: Path, served: str | None) -> bool:
    """Return whether a file is of radarsim's, and not the simulated map."""
    try:
        with path.open("rb") as file:
            is_ours = is_radarsim_map(file.read(HEAD)) or is_by_radarsim(path)
            return is_ours and not _is_same(path, served)
    except OSError:
        return True


def _is_same(path: Path, served: str | None) -> bool:
    with suppress(OSError):  # the simulated map is a shipped one, given by its name
        return served is not None and path.samefile(served)
    return False


def view_of(result: MappingResult, mapper: Mapper) -> MapView:
    """Return how the map of a run is drawn.

    Args:
        result: The run.
        mapper: Holds the map; at least one scan.
    """
    scene, trip, outlines = result.scene, result.trip, _true_outlines(result, mapper)
    ending = TITLE_ENDINGS.get(result.outcome, "")
    path = f"{trip.length:.1f} m in {trip.time:.0f} s {ending}".rstrip()
    return MapView(
        mapper.grid,
        mapper.trajectory.rows(),
        drawn_robot(result.robot_class).name,
        _headline(result, mapper, outlines),
        outlines,
        f"{_who_maps_what(result)}: {path}",
        () if scene is None else tuple(scene.parts),
        0.0 if scene is None else _sensor_height(result, mapper),
    )


def _headline(
    result: MappingResult, mapper: Mapper, outlines: Iterable[Outline]
) -> str:
    score = result.score
    if score is not None and score.hidden_coverage is not None:
        return _hidden_text(score.hidden_coverage, outlines)
    if score is not None and score.coverage is not None:
        return f"{100 * score.coverage:.0f} % of the floor mapped"
    grid = mapper.grid
    area = np.count_nonzero(grid.sensed_cells()) * grid.frame.resolution**2
    return f"{area:.0f} m² mapped"


def _who_maps_what(result: MappingResult) -> str:
    where = "what it senses" if result.scene is None else result.scene.name
    who = result.robot_class or "a robot that another client drives"
    return f"{who[0].upper()}{who[1:]} maps {where}"


def _true_outlines(result: MappingResult, mapper: Mapper) -> tuple[Outline, ...]:
    """Return the outlines of the scene at the sensor's height, if it is known."""
    if result.scene is None:
        return ()
    return outlines_of(result.scene, _sensor_height(result, mapper))


def _hidden_text(share: float, outlines: Iterable[Outline]) -> str:
    """Return how much of the floor that the robot cannot reach is mapped, in words."""
    is_foliage = any(outline.kind == "foliage" for outline in outlines)
    where = "behind the foliage" if is_foliage else "out of the robot's reach"
    return f"The floor {where}: {100 * share:.0f} % mapped"


def _sensor_height(result: MappingResult, mapper: Mapper) -> float:
    assert result.scene is not None
    x, y, _ = mapper.trajectory.rows()[0].tolist()
    above = drawn_robot(result.robot_class).origin_height + mapper.scanner.mount.z
    return result.scene.floor_at(x, y) + above


def map_camera(
    result: MappingResult, source: Exploration | WatchMapper
) -> Callable[[], Pixels]:
    """Return a function that draws a map as it is; at least one scan is on it.

    Args:
        result: Tells the robot and, if it is known, the scene.
        source: Holds the map and the distance so far.
    """

    @cache  # not before the first scan: only then it is known where the robot stands
    def prepare(
        mapper: Mapper,
    ) -> tuple[MapFrames, tuple[Outline, ...], FloorPart | None]:
        scene, resolution = result.scene, mapper.grid.frame.resolution
        robot = drawn_robot(result.robot_class)
        outlines = _true_outlines(result, mapper)
        x, y, _ = mapper.trajectory.rows()[0].tolist()
        extent, title = first_map_extent(outlines, mapper.grid), _who_maps_what(result)
        frames = MapFrames(extent, resolution, title, robot.name, outlines)
        if scene is None:
            return frames, outlines, None
        hidden = FloorPart(
            "hidden",
            scene,
            resolution,
            start=(x, y),
            robot_radius=math.hypot(robot.length, robot.width) / 2,
            height=_sensor_height(result, mapper),
        )
        return frames, outlines, hidden

    def draw() -> Pixels:
        mapper, trip = source.mapper, source.trip
        assert mapper is not None
        frames, outlines, hidden = prepare(mapper)
        text = f"{trip.time:.1f} s, {trip.length:.1f} m"
        share = None if hidden is None else hidden.coverage(mapper.grid)
        if share is not None:
            text = f"{_hidden_text(share, outlines)}, {text}"
        return frames.draw(mapper.grid, mapper.trajectory.rows(), text)

    return draw
