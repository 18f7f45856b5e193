"""The files that ``radarsim map`` writes."""

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import typer

from radarsim.atomic_write import write_atomically
from radarsim.cli.options import check_writable
from radarsim.evaluation.mapping_run import MappingResult
from radarsim.mapping.export import HEAD, NavMode, commander_png, is_ours, nav_map
from radarsim.mapping.mapper import Mapper
from radarsim.mapping.trajectory import tum_text

IN_FOLDER: Final = "map"  # what names begin with in a folder
FILE_SUFFIXES: Final = (".png", ".pgm", ".yaml", ".tum")


@dataclass(frozen=True, slots=True)
class MapFiles:
    """Where a map is to be.

    Attributes:
        out: A folder, or what the names of the files begin with; with an ending of
            one of the files, or without.
        mode: What the map for nav2 tells.
    """

    out: str
    mode: NavMode

    @property
    def stem(self) -> Path:
        """The path that all files begin with."""
        path = Path(self.out)
        if path.is_dir() or self.out.endswith(("/", os.sep)):
            return path / IN_FOLDER
        return path.with_suffix("") if path.suffix in FILE_SUFFIXES else path

    @property
    def paths(self) -> tuple[Path, ...]:
        """All files: the picture, the image for nav2 and its YAML, the trajectory."""
        stem = self.stem
        name, image = stem.name, ".pgm"
        if self.mode == "scale":
            name, image = f"{name}_scale", ".png"
        names = (f"{stem.name}.png", name + image, f"{name}.yaml", f"{stem.name}.tum")
        return tuple(stem.with_name(each) for each in names)

    def check(self, served: str | None = None) -> None:
        """Find out before the robot drives what could not be written after it.

        A folder that is not there is made if its name ends in a slash.

        Args:
            served: The map that is simulated, or None.

        Raises:
            typer.BadParameter: If there is no such folder, no right to write there, or
                a file of somebody else's in the way.
        """
        stem = self.stem
        try:
            if self.out.endswith(("/", os.sep)):
                stem.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            text = f"cannot make {stem.parent}: {error.strerror}"
            raise typer.BadParameter(text, param_hint="OUT") from None
        for path in self.paths:
            check_writable(path, "OUT")
            if path.is_file() and not _may_go(path, served):
                text = f"{path} is no map of radarsim's, expected another OUT"
                raise typer.BadParameter(text, param_hint="OUT")

    def write(self, mapper: Mapper | None) -> tuple[Path, ...]:
        """Write what there is of a map; gives the files, none if there is nothing.

        Raises:
            OSError: If that cannot be; then nothing has changed.
        """
        if mapper is None or not mapper.scans:
            return ()
        paths, grid = self.paths, mapper.grid
        image, words = nav_map(grid, paths[2].stem, mode=self.mode).values()
        way = tum_text(mapper.trajectory).encode()
        data = (commander_png(grid), image, words, way)
        write_atomically(dict(zip(paths, data, strict=True)))
        return paths


def _may_go(path: Path, served: str | None) -> bool:
    """Tell whether a file may be replaced."""
    try:
        with path.open("rb") as file:
            ours = is_ours(file.read(HEAD))
        return ours and not (served is not None and path.samefile(served))
    except OSError:  # of a map that is shipped, and has no path
        return True


def reason(error: OSError) -> str:
    """Say why a map is not there."""
    name = "the map" if error.filename is None else error.filename
    return f"cannot write {name}: {error.strerror or error}"


# Section from cli.mapoutcomes.
# What is said of a map once it is made.

CLASSES: Final = ("free", "obstacle", "foliage", "smoke")
ENDINGS: Final = {
    "time_limit": "time is up",
    "broken_off": "broken off",
    "overheard": "mapped what passed",
}


def keep(run: MappingResult, files: MapFiles) -> None:
    """Write what there is of a map; say on stderr why that cannot be."""
    try:
        run.files = files.write(run.mapper)
    except OSError as error:
        fault = reason(error)
        sys.stderr.write(f"radarsim: {fault}\n")
        run.error = f"{run.error}; {fault}" if run.error else fault


def as_text(run: MappingResult) -> list[str]:
    """Give that for people, in lines."""
    told = run.to_dict()
    ending = ENDINGS.get(run.outcome, run.outcome)
    by = "" if run.strategy is None else f" by {run.strategy}"
    path = f"{told['path_length']:.2f} m in {told['time']:.1f} s"
    lines = [f"{ending}{by}: {path}, {told['scans']} scans"]
    if cells := told["cells"]:
        area = cells["resolution"] ** 2
        parts = [f"{cells[name] * area:.2f} m² {name}" for name in CLASSES]
        lines.append(f"map      {', '.join(parts)}")
    if errors := told["pose_errors"]:
        lines.append(
            f"pose     {errors['ate']:.3f} m and {errors['yaw_deg']:.2f} degrees off,"
            f" at most {errors['ate_max']:.3f} m and {errors['yaw_max_deg']:.2f}"
        )
    if run.unreached:
        places = ", ".join(f"{x:g} {y:g}" for x, y in run.unreached)
        lines.append(f"left out {places}: no way there")
    if judge := told.get("judge"):
        lines.append(f"in truth {_verdict(judge)}")
    if run.files:
        names = (f"{file.name}" for file in run.files)
        lines.append(f"files    {', '.join(names)} in {run.files[0].parent}")
    return lines


def _verdict(judge: dict[str, Any]) -> str:
    parts = [f"{judge['path_length']:.2f} m"]
    if judge.get("coverage") is not None:
        near = f"{judge['near_coverage']:.1%} at short range"
        parts.append(f"{judge['coverage']:.1%} of the floor sensed, {near}")
    if judge.get("hidden_coverage") is not None:
        parts.append(f"{judge['hidden_coverage']:.1%} of what it cannot get to")
    if "right" in judge:
        parts.append(f"{judge['right']} cells right, {judge['wrong']} wrong")
    parts.append(f"collisions: {judge['collisions']}")
    return ", ".join(parts)
