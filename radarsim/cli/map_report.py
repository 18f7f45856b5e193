"""The files that ``radarsim map`` writes, and what it prints."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import typer

from radarsim.atomic_write import write_atomically
from radarsim.cli.map_view import view_of
from radarsim.cli.options import check_writable
from radarsim.cli.output import print_lines, print_message
from radarsim.cli.progress import live_status
from radarsim.evaluation.mapping_run import MappingResult
from radarsim.exploration.exploration import Exploration
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
from radarsim.proxy.traffic_mapper import TrafficMapper

DEFAULT_STEM: Final = "map"  # of the names of files in a folder
FILE_SUFFIXES: Final = (".png", ".pgm", ".yaml", ".tum")
CLASSES: Final = ("free", "obstacle", "foliage", "smoke")
ENDINGS: Final = {
    "time_limit": "time is up",
    "broken_off": "interrupted",
    "overheard": "mapped what passed",
    "watched": "mapped what was watched",
}


@dataclass(frozen=True, slots=True)
class MapFiles:
    """The files of a map.

    Attributes:
        out: A folder, or what the names of the files begin with; the suffix of one of
            the files may follow.
        mode: Contents of the map for nav2.
    """

    out: str
    mode: NavMode

    @property
    def stem(self) -> Path:
        """The path that the names of all files begin with."""
        path = Path(self.out)
        if self._names_folder or _is_folder(path):
            return path / DEFAULT_STEM
        return path.with_suffix("") if path.suffix in FILE_SUFFIXES else path

    @property
    def paths(self) -> tuple[Path, ...]:
        """All files: the cells, nav2's image and YAML, the trajectory, the picture."""
        stem = self.stem
        name, image = stem.name, ".pgm"
        if self.mode == "scale":
            name, image = f"{name}_scale", ".png"
        names = (
            f"{stem.name}.png",
            name + image,
            f"{name}.yaml",
            f"{stem.name}.tum",
            f"{stem.name}_view.png",
        )
        return tuple(stem.with_name(each) for each in names)

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
        trajectory = tum_text(mapper.trajectory).encode()
        view = draw_map_view(view_of(result, mapper))
        contents = (commander_png(grid), image, yaml, trajectory, view)
        write_atomically(dict(zip(paths, contents, strict=True)))
        return paths


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


@contextmanager
def map_progress(
    source: Exploration | TrafficMapper,
) -> Iterator[Callable[[str], None]]:
    """Show the progress of a map on stderr.

    Args:
        source: Holds the map and the distance so far.

    Yields:
        A function to be called after each scan with what the robot is doing.
    """
    activity = "waiting for a scan"
    with live_status(lambda: _describe_status(source, activity)) as log:

        def update(latest: str) -> None:
            nonlocal activity
            if latest != activity:
                activity = latest
                log(_describe_status(source, activity))

        yield update


def _describe_status(source: Exploration | TrafficMapper, activity: str) -> str:
    mapper, trip = source.mapper, source.trip
    if mapper is None or not mapper.scans:
        return activity
    cells = int(np.count_nonzero(mapper.grid.sensed_cells()))
    area = f"sensed {cells * mapper.grid.frame.resolution**2:7.1f} m²"
    return f"{trip.time:8.1f} s  {activity:9}  path {trip.length:6.2f} m  {area}"


def print_result(result: MappingResult, *, as_json: bool) -> None:
    """Print a result; one that failed before its first scan only as JSON."""
    if as_json:
        print_lines([result.to_json()])
    elif result.trip.start is not None or not result.error:
        print_lines(as_text(result))


def as_text(result: MappingResult) -> list[str]:
    """Return a result as lines of text."""
    plain = result.to_dict()
    ending = ENDINGS.get(result.outcome, result.outcome)
    by = "" if result.strategy is None else f" by {result.strategy}"
    path = f"{plain['path_length']:.2f} m in {plain['time']:.1f} s"
    lines = [f"{ending}{by}: {path}, {plain['scans']} scans"]
    if cells := plain["cells"]:
        area = cells["resolution"] ** 2
        areas = [f"{cells[name] * area:.2f} m² {name}" for name in CLASSES]
        lines.append(f"map      {', '.join(areas)}")
    if errors := plain["pose_errors"]:
        lines.append(
            f"pose     {errors['ate']:.3f} m and {errors['yaw_deg']:.2f} degrees off,"
            f" at most {errors['ate_max']:.3f} m and {errors['yaw_max_deg']:.2f}"
        )
    if result.unreached:
        points = ", ".join(f"{x:g} {y:g}" for x, y in result.unreached)
        lines.append(f"left out {points}: no way there")
    if judge := plain.get("judge"):
        lines.append(f"in truth {_judge_text(judge)}")
    if result.files:
        names = ", ".join(file.name for file in result.files)
        lines.append(f"files    {names} in {result.files[0].parent}")
    return lines


def _judge_text(judge: dict[str, Any]) -> str:
    texts = [f"{judge['path_length']:.2f} m"]
    if judge.get("coverage") is not None:
        near = f"{judge['near_coverage']:.1%} at short range"
        texts.append(f"{judge['coverage']:.1%} of the floor sensed, {near}")
    if judge.get("hidden_coverage") is not None:
        texts.append(f"{judge['hidden_coverage']:.1%} of what it cannot get to")
    if "right" in judge:
        texts.append(f"{judge['right']} cells right, {judge['wrong']} wrong")
    texts.append(f"collisions: {judge['collisions']}")
    return ", ".join(texts)
