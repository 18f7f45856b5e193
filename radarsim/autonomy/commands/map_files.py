"""The files that ``radarsim map`` writes, and what else is made of a run.

Pictures and films show the result of the run.
"""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import click
import numpy as np

from radarsim.addons.recording.run_recording import RunRecording
from radarsim.autonomy.commands.film import check_film, drawn_robot
from radarsim.autonomy.commands.map import MOST_ROBOTS
from radarsim.autonomy.evaluation.map_truth import HiddenFloor
from radarsim.autonomy.evaluation.mapping_run import MappingResult
from radarsim.autonomy.exploration.exploration import Exploration
from radarsim.autonomy.mapping.export import (
    HEAD,
    NavMode,
    commander_png,
    is_radarsim_map,
    nav_map,
)
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.mapping.trajectory import tum_text
from radarsim.autonomy.plotting.film import Pixels
from radarsim.autonomy.plotting.map_film import MapFrames, first_extent
from radarsim.autonomy.plotting.maps import MapView, draw_map_view, joined
from radarsim.autonomy.plotting.outlines import Outline, outlines_of
from radarsim.autonomy.proxy.traffic_mapper import TrafficMapper
from radarsim.cli.files import check_writable
from radarsim.cli.output import print_message
from radarsim.errors import describe_os_error
from radarsim.files import write_atomically

TITLE_ENDINGS: Final = {
    "incomplete": "until nothing was left to try",
    "time_limit": "until time was up",
    "stuck": "until the robot was stuck",
    "failed": "until the run failed",
    "broken_off": "until interrupted",
}


def view_of(result: MappingResult, mapper: Mapper) -> MapView:
    """Return how the map of a run is drawn.

    Args:
        result: The run.
        mapper: Holds the map; at least one scan.
    """
    scene = result.scene
    trajectories = result.trajectories or {1: mapper.trajectory}
    paths = [each.rows() for each in trajectories.values()]
    robots = tuple(trajectories) if result.robots > 1 else ()
    return MapView(
        mapper.grid,
        joined(paths),
        drawn_robot(result.robot_class).name,
        headline(result, mapper),
        true_outlines(result, mapper),
        _summary(result),
        () if scene is None else tuple(scene.parts),
        0.0 if scene is None else _sensor_height(result, mapper),
        robots,
    )


def headline(result: MappingResult, mapper: Mapper) -> str:
    """Return how much is on a map, in words."""
    score = result.score
    if score is not None and score.hidden_coverage is not None:
        return hidden_text(score.hidden_coverage, true_outlines(result, mapper))
    if score is not None and score.coverage is not None:
        return f"{100 * score.coverage:.0f} % of the floor mapped"
    grid = mapper.grid
    area = np.count_nonzero(grid.sensed_cells()) * grid.frame.resolution**2
    return f"{area:.0f} m² mapped"


def who_maps_what(result: MappingResult) -> str:
    """Return the robot, or the robots, and the scene, in words."""
    where = "what it senses" if result.scene is None else result.scene.name
    if result.robots > 1:
        where = "what they sense" if result.scene is None else where
        return f"{result.robots} robots {result.robot_class} map {where}"
    who = result.robot_class or "a robot that another client drives"
    return f"{who[0].upper()}{who[1:]} maps {where}"


def true_outlines(result: MappingResult, mapper: Mapper) -> tuple[Outline, ...]:
    """Return the outlines of the scene at the sensor's height, if it is known."""
    if result.scene is None:
        return ()
    return outlines_of(result.scene, _sensor_height(result, mapper))


def hidden_text(share: float | None, outlines: Iterable[Outline]) -> str:
    """Return how much of the floor that the robot cannot reach is mapped.

    Args:
        share: Share of it; None if there is no such floor, for an empty text.
        outlines: What is truly there, which tells what the floor is behind.
    """
    if share is None:
        return ""
    is_foliage = any(outline.kind == "foliage" for outline in outlines)
    where = "behind the foliage" if is_foliage else "out of the robot's reach"
    return f"The floor {where}: {100 * share:.0f} % mapped"


def _summary(result: MappingResult) -> str:
    ending = TITLE_ENDINGS.get(result.outcome, "")
    path = f"{result.trip.length:.1f} m in {result.trip.time:.0f} s {ending}".rstrip()
    return f"{who_maps_what(result)}: {path}"


def _sensor_height(result: MappingResult, mapper: Mapper) -> float:
    assert result.scene is not None
    x, y, _ = mapper.trajectory.rows()[0].tolist()
    above = drawn_robot(result.robot_class).origin_height + mapper.scanner.mount.z
    return result.scene.floor_at(x, y) + above


class MapCamera:
    """Draws frames of a map as it is made."""

    def __init__(
        self, result: MappingResult, source: Exploration | TrafficMapper
    ) -> None:
        """Prepare films.

        Args:
            result: Tells the robot and, if it is known, the scene.
            source: Holds the map and the distance so far.
        """
        self._result, self._source = result, source
        self._mapper: Mapper | None = None
        self._frames: MapFrames | None = None
        self._hidden: HiddenFloor | None = None
        self._outlines: tuple[Outline, ...] = ()

    def draw(self) -> Pixels:
        """Draw the map as it is, or as it was last; at least one scan is on it."""
        mapper, trip = self._source.mapper or self._mapper, self._source.trip
        assert mapper is not None
        self._mapper = mapper
        if self._frames is None:
            self._frames = self._prepare(mapper)
        share = None if self._hidden is None else self._hidden.coverage(mapper.grid)
        path = f"{trip.time:.1f} s, {trip.length:.1f} m"
        hidden = hidden_text(share, self._outlines)
        status = ", ".join(text for text in (hidden, path) if text)
        return self._frames.draw(mapper.grid, mapper.trajectory.rows(), status)

    def _prepare(self, mapper: Mapper) -> MapFrames:
        result, resolution = self._result, mapper.grid.frame.resolution
        outlines, robot = true_outlines(result, mapper), drawn_robot(result.robot_class)
        self._outlines = outlines
        x, y, _ = mapper.trajectory.rows()[0].tolist()
        if result.scene is not None:
            self._hidden = HiddenFloor(
                result.scene,
                resolution,
                start=(x, y),
                robot_radius=math.hypot(robot.length, robot.width) / 2,
                height=_sensor_height(result, mapper),
            )
        extent = first_extent(outlines, mapper.grid)
        title = who_maps_what(result)
        return MapFrames(extent, resolution, title, robot.name, outlines)


DEFAULT_STEM: Final = "map"  # of the names of files in a folder
FILE_SUFFIXES: Final = (".png", ".pgm", ".yaml", ".tum")


@dataclass(frozen=True, slots=True)
class MapFiles:
    """The files of a map.

    Attributes:
        out: A folder, or what the names of the files begin with; the suffix of one of
            the files may follow.
        mode: Contents of the map for nav2.
        robots: Number of robots; each has a trajectory.
    """

    out: str
    mode: NavMode
    robots: int = 1

    @property
    def stem(self) -> Path:
        """The path that the names of all files begin with."""
        path = Path(self.out)
        if self._names_folder or _is_folder(path):
            return path / DEFAULT_STEM
        return path.with_suffix("") if path.suffix in FILE_SUFFIXES else path

    @property
    def paths(self) -> tuple[Path, ...]:
        """All files: cells, nav2's image and YAML, trajectory, picture, others."""
        stem = self.stem
        name, image = stem.name, ".pgm"
        if self.mode == "scale":
            name, image = f"{name}_scale", ".png"
        return (
            stem.with_name(f"{stem.name}.png"),
            stem.with_name(name + image),
            stem.with_name(f"{name}.yaml"),
            self._trajectory_path(1),
            stem.with_name(f"{stem.name}_view.png"),
            *(self._trajectory_path(robot) for robot in range(2, self.robots + 1)),
        )

    def _trajectory_path(self, robot: int) -> Path:
        stem = self.stem
        number = "" if robot == 1 else f"_robot{robot}"
        return stem.with_name(f"{stem.name}{number}.tum")

    @property
    def _names_folder(self) -> bool:
        return self.out.endswith(("/", os.sep))

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
                text = f"{path} is no map of radarsim's, expected another OUT"
                raise click.BadParameter(text, param_hint="-o")

    def write(self, result: MappingResult) -> tuple[Path, ...]:
        """Write the map of a run, and return its files; none if there was no scan.

        Raises:
            OSError: If they cannot be written; then no file has changed.
        """
        mapper = result.mapper
        if mapper is None or not mapper.scans:
            return ()
        paths, grid = self.paths, mapper.grid
        image, yaml = nav_map(grid, paths[2].stem, mode=self.mode).values()
        contents = {
            paths[0]: commander_png(grid),
            paths[1]: image,
            paths[2]: yaml,
            paths[4]: draw_map_view(view_of(result, mapper)),
        }
        for robot, trajectory in result.trajectories.items():
            contents[self._trajectory_path(robot)] = tum_text(trajectory).encode()
        files = {path: contents[path] for path in paths if path in contents}
        write_atomically(files)
        self._remove_others(files)
        return tuple(files)

    def _remove_others(self, files: Collection[Path]) -> None:
        """Remove what an earlier run of more robots wrote, and nobody else."""
        for robot in range(2, MOST_ROBOTS + 1):
            path = self._trajectory_path(robot)
            if path not in files and path.is_file() and _may_be_replaced(path, None):
                path.unlink()


def _is_folder(path: Path) -> bool:
    """Return whether there is a folder; False where it cannot be known."""
    with suppress(OSError):
        return path.is_dir()
    return False


def _may_be_replaced(path: Path, served: str | None) -> bool:
    """Return whether a file is a map that radarsim wrote, and not the simulated one."""
    try:
        with path.open("rb") as file:
            is_by_radarsim = is_radarsim_map(file.read(HEAD))
        return is_by_radarsim and not (served is not None and path.samefile(served))
    except OSError:  # the simulated map is a shipped one, given by its name
        return True


def save_map(result: MappingResult, files: MapFiles) -> None:
    """Write a map; note in the result, and on stderr, why it cannot be written."""
    try:
        result.files = files.write(result)
    except OSError as error:
        name = "the map" if error.filename is None else error.filename
        text = f"cannot write {name}: {describe_os_error(error)}"
        print_message(text)
        result.error = f"{result.error}; {text}" if result.error else text


@dataclass(frozen=True, slots=True)
class MapOutput:
    """What is made of a run.

    Attributes:
        files: Files of the map.
        recording: Records what passes, and the map.
        film: File to film the growing map into, or None.
        film_speed: Seconds of the run in a second of its film.
        as_json: Whether to print JSON.
    """

    files: MapFiles
    recording: RunRecording
    film: Path | None
    film_speed: float
    as_json: bool

    def check(self, served: str | None = None) -> None:
        """Check before the robot drives that everything can be written after it.

        Args:
            served: The map that is simulated, or None.

        Raises:
            click.BadParameter: If something cannot.
        """
        self.files.check(served=served)
        check_film(self.film)
