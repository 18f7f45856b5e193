"""The files that ``radarsim map`` writes."""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import click

from radarsim.autonomy.cli.map_view import view_of
from radarsim.autonomy.evaluation.mapping_run import MappingResult
from radarsim.autonomy.mapping.export import (
    HEAD,
    NavMode,
    commander_png,
    is_radarsim_map,
    nav_map,
)
from radarsim.autonomy.mapping.trajectory import tum_text
from radarsim.autonomy.plotting.maps import draw_map_view
from radarsim.cli.files import check_writable
from radarsim.errors import describe_os_error
from radarsim.files import is_by_radarsim, write_atomically

DEFAULT_STEM: Final = "map"  # of the names of files in a folder
FILE_SUFFIXES: Final = (".png", ".pgm", ".yaml", ".tum")


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
        path, is_folder = Path(self.out), self._names_folder
        with suppress(OSError):  # as of a name that is too long
            is_folder = is_folder or path.is_dir()
        if is_folder:
            return path / DEFAULT_STEM
        return path.with_suffix("") if path.suffix in FILE_SUFFIXES else path

    @property
    def paths(self) -> tuple[Path, ...]:
        """All files: cells, nav2's image and YAML, trajectory, picture."""
        stem = self.stem
        name, image = stem.name, ".pgm"
        if self.mode == "scale":
            name, image = f"{name}_scale", ".png"
        return (
            stem.with_name(f"{stem.name}.png"),
            stem.with_name(name + image),
            stem.with_name(f"{name}.yaml"),
            stem.with_name(f"{stem.name}.tum"),
            stem.with_name(f"{stem.name}_view.png"),
        )

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
                is_served = _is_same(path, served)
                what = "the simulated map" if is_served else "of another program"
                text = f"would overwrite {path}, which is {what}, expected -o OUT"
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
            paths[3]: tum_text(mapper.trajectory).encode(),
            paths[4]: draw_map_view(view_of(result, mapper)),
        }
        # all or none: old and new files never stand side by side
        write_atomically(contents)
        return paths


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
