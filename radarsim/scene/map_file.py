"""Find map files and load scenes from them; no other module reads map files.

A map is a YAML file with its meshes in other files; `map_schema` defines its keys.
"""

import stat
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import Final

from radarsim.errors import MapError, describe_os_error, did_you_mean
from radarsim.scene.map_loader import MapLoader, load_scene
from radarsim.scene.scene import Scene
from radarsim.validation import short_repr
from radarsim.yaml_reader import YamlFile, read_yaml

MAX_NAME_LENGTH: Final = 1000  # characters; messages shorten longer paths


def find_map(path_or_name: str | Path) -> tuple[Path, str | None]:
    """Return the path of a map file and the name of the selected variant.

    The text after the last ``@`` is the variant, unless a file has the whole name.
    A file takes precedence over a shipped map of the same name.

    Raises:
        MapError: If there is no such file and no such shipped map.
        TypeError: If the argument is neither a name nor a path.
    """
    if not isinstance(path_or_name, str | PathLike):
        expected = "expected the name of a map, or the path of its file"
        raise TypeError(f"map {path_or_name!r:.80}, {expected}")
    name = str(path_or_name)
    # The whole name is tried first, since file names may contain an @.
    if path := _find(name):
        return path, None
    stem, separator, variant = name.rpartition("@")
    if separator and (path := _find(stem)):
        return path, variant
    raise MapError([_not_found(name)])


def _not_found(name: str) -> str:
    """Return the message for a map that does not exist, with a similar name."""
    plain = name.isprintable() and len(name) <= MAX_NAME_LENGTH
    shipped = sorted(shipped_maps())
    expected = f"expected a map file or one of {shipped}"
    reason, stem = "no such file", name.rpartition("@")[0]
    others: list[str] = []
    try:
        found = map(str, Path(name).parent.glob("*.yaml"))
        others = [path for path in found if path != name]
        mode = Path(name).stat().st_mode
        reason = "a folder" if stat.S_ISDIR(mode) else "not a regular file"
    except (OSError, ValueError) as error:  # also if the name is too long, or has a NUL
        if isinstance(error, PermissionError):
            reason = describe_os_error(error)
    meant = did_you_mean(name, [*others, *shipped]) or did_you_mean(stem, shipped)
    return f"{name if plain else short_repr(name)}: {reason}{meant}, {expected}"


def _find(name: str) -> Path | None:
    with suppress(OSError, ValueError):  # raised if a name is too long, or has a NUL
        if Path(name).is_file():
            return Path(name)
    return shipped_maps().get(name)


def shipped_maps() -> dict[str, Path]:
    """Return the paths of the maps that come with radarsim, by name."""
    package = Path(__file__).resolve().parents[1]
    folder = package / "maps"  # in an installed wheel
    if not folder.is_dir():
        folder = package.parent / "maps"  # in a checkout
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def load_map(path_or_name: str | Path) -> Scene:
    """Load the scene that a map file describes.

    Args:
        path_or_name: The path of a map file, or the name of a shipped map; the suffix
            ``@NAME`` selects a variant of the map.

    Raises:
        MapError: If the map or the selected variant has problems; the error lists them.
        TypeError: If the argument is neither a name nor a path.
    """
    path, variant = find_map(path_or_name)
    return load_scene(_read(path), variant)


def load_variants(path_or_name: str | Path) -> list[Scene]:
    """Load a map and then its variants, or only the variant that the name selects.

    Raises:
        MapError: If the map or a variant has problems; the error lists them.
    """
    path, selected = find_map(path_or_name)
    loader = MapLoader(_read(path))
    scenes = [loader.load(selected)]
    if selected is None:
        scenes += map(loader.load, loader.variants())
    loader.problems.raise_all()
    return scenes


def _read(path: Path) -> YamlFile:
    try:
        file = read_yaml(path)
    except OSError as error:
        reason = describe_os_error(error)
        raise MapError([f"{path}: {reason}, expected a map file"]) from error
    if isinstance(file.data, dict) and {"image", "resolution"} <= file.data.keys():
        text = "a map of ROS map_server, which 'radarsim import' can convert"
        raise MapError([file.problem(("image",), text)])
    return file
