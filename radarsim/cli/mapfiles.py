"""The files that ``radarsim map`` writes."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import typer

from radarsim.cli.files import check_place
from radarsim.mapping.mapper import Mapper
from radarsim.mapping.outputs import HEAD, NavMode, commander_png, is_ours, nav_map
from radarsim.mapping.trajectory import tum_text
from radarsim.wholefile import write_whole

IN_FOLDER: Final = "map"  # what names begin with in a folder
ENDINGS: Final = (".png", ".pgm", ".yaml", ".tum")


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
        return path.with_suffix("") if path.suffix in ENDINGS else path

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
            check_place(path, "OUT")
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
        write_whole(dict(zip(paths, data, strict=True)))
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
