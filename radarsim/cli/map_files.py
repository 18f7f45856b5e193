"""The files that ``radarsim map`` writes, and what else is made of a run."""

from __future__ import annotations

import os
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import typer

from radarsim.atomic_write import write_atomically
from radarsim.cli.film import check_film
from radarsim.cli.map_options import MOST_ROBOTS
from radarsim.cli.map_view import view_of
from radarsim.cli.options import check_writable
from radarsim.cli.output import print_message
from radarsim.cli.run_recording import RunRecording
from radarsim.evaluation.mapping_run import MappingResult
from radarsim.mapping.export import (
    HEAD,
    NavMode,
    commander_png,
    is_radarsim_map,
    nav_map,
)
from radarsim.mapping.trajectory import tum_text
from radarsim.os_errors import describe_os_error
from radarsim.plotting.maps import draw_map_view

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
            typer.BadParameter: If the folder is missing or not writable, or a file of
                another program would be overwritten.
        """
        folder = self.stem.parent
        try:
            if self._names_folder:
                folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            text = f"cannot make {folder}: {describe_os_error(error)}"
            raise typer.BadParameter(text, param_hint="OUT") from None
        for path in self.paths:
            check_writable(path, "OUT")
            if path.is_file() and not _may_be_replaced(path, served):
                text = f"{path} is no map of radarsim's, expected another OUT"
                raise typer.BadParameter(text, param_hint="OUT")

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
            typer.BadParameter: If something cannot.
        """
        self.files.check(served=served)
        check_film(self.film)
