"""Files of meshes: which ones may be read, and how large they may be."""

import os
from pathlib import Path
from typing import Final

from radarsim.validation import short_repr

MAX_TRIANGLES: Final = 4_000_000
MAX_FILE_BYTES: Final = 256 * 1024 * 1024
MAX_TEXT_BYTES: Final = 32 * 1024 * 1024  # parsers of text take 20 times its size
MAX_SURFACES: Final = 2_000  # pieces of one mesh file, each with a material

_LIMITS: Final = {
    "triangles": MAX_TRIANGLES,
    "bytes": MAX_FILE_BYTES,
    "bytes of text": MAX_TEXT_BYTES,
}


class MeshError(Exception):
    """A mesh file cannot be used; the message says why."""


class MeshBudget:
    """What all mesh files of one map may contain together, and what is left of it."""

    def __init__(self) -> None:
        self._taken = dict.fromkeys(_LIMITS, 0)

    def take(self, count: int, what: str) -> None:
        """Count things that a file has or announces.

        Raises:
            MeshError: If they are more than is left.
        """
        limit = _LIMITS[what]
        if self._taken[what] + count > limit:
            expected = f"expected at most {limit} in all mesh files of a map"
            raise MeshError(f"{count} {what}, {expected}")
        self._taken[what] += count


class MeshFiles:
    """Reads a mesh file, and on its behalf the files that it refers to.

    It is the resolver that trimesh asks for these; virtual ones are added by name.

    Attributes:
        budget: What these files may contain, with all others of the map.
    """

    file_name = None  # trimesh asks for it

    def __init__(self, start: Path, folder: Path, budget: MeshBudget) -> None:
        """Start with nothing read.

        Args:
            start: The folder that references are relative to.
            folder: The folder that must contain all files, links resolved.
            budget: What these files may contain, with all others of the map.
        """
        self.budget = budget
        self._start = start
        self._folder = folder
        self._virtual: dict[str, bytes | memoryview] = {}

    def read(self, path: Path) -> bytes:
        """Return the bytes of a file.

        Raises:
            MeshError: If all files together are too large.
            OSError: If it cannot be read.
        """
        size = path.stat().st_size
        self.budget.take(size, "bytes")
        with path.open("rb") as file:
            return file.read(size)

    def add(self, name: str, content: bytes | memoryview) -> None:
        """Add a virtual file."""
        self._virtual[name] = content

    def find(self, reference: str) -> Path:
        """Return the path of a file that the mesh file refers to.

        Raises:
            MeshError: If it is outside of the folder, or missing.
        """
        try:
            return find_inside(self._folder, self._start, reference)
        except MeshError as error:
            raise MeshError(f"refers to {error}") from error

    def get(self, name: str) -> bytes | memoryview:
        """Return a virtual file; nothing else is read for trimesh."""
        if name not in self._virtual:
            raise FileNotFoundError(name)
        return self._virtual[name]

    __getitem__ = get


def find_inside(folder: Path, start: Path, reference: str) -> Path:
    """Resolve a reference to a file, following symbolic links.

    Args:
        folder: The folder that must contain the file, links resolved.
        start: The folder that the reference is relative to.
        reference: A relative path.

    Raises:
        MeshError: If it leads out of the folder, or there is no such file.
    """
    try:
        found = _find(os.path.join(start, reference))  # noqa: PTH118 - Path is slower
        is_inside = os.path.commonpath([folder, found]) == str(folder)
        exists = os.path.isfile(found)  # noqa: PTH113
    except (OSError, RuntimeError, ValueError) as error:  # loops, NUL, endless names
        text = f"{short_repr(reference)}, expected the path of a file"
        raise MeshError(text) from error
    if not is_inside:
        text = f"{short_repr(reference)}, expected a file in the map's own folder"
        raise MeshError(text)
    if not exists:
        raise MeshError(f"{short_repr(reference)}, expected an existing file")
    return Path(found)


def _find(path: str) -> str:
    """Resolve a path; one of nothing need not be resolved, which takes longer."""
    try:
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError):
        return os.path.normpath(path)
    return str(Path(path).resolve())


def expect_at_most(count: int, most: int, what: str) -> None:
    """Check a count against a limit.

    Raises:
        MeshError: If it is larger.
    """
    if count > most:
        raise MeshError(f"{count} {what}, expected at most {most}")
