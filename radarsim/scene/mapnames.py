"""Where maps are: at a path, or shipped; and which variant of one is meant."""

from contextlib import suppress
from pathlib import Path

from radarsim.errors import MapError
from radarsim.yamlfile import shown


def find_map(path_or_name: str | Path) -> tuple[Path, str | None]:
    """Find the file of a map, and the name of the variant that is asked for.

    The name of a variant follows the map after an ``@``, unless there is a file that is
    called so as a whole. A file at a path comes before a shipped map's name.

    Raises:
        MapError: If there is neither.
    """
    name = str(path_or_name)
    if path := _find(name):
        return path, None
    stem, at, variant = name.rpartition("@")
    if at and (path := _find(stem)):
        return path, variant
    plain = name.isprintable() and len(name) <= 80
    expected = f"expected a map file or one of {sorted(shipped_maps())}"
    raise MapError([f"{name if plain else shown(name)}: no such file, {expected}"])


def _find(name: str) -> Path | None:
    with suppress(OSError, ValueError):  # endless names, NUL
        if Path(name).is_file():
            return Path(name)
    return shipped_maps().get(name)


def shipped_maps() -> dict[str, Path]:
    """Give the maps that come with radarsim, by name."""
    package = Path(__file__).resolve().parents[1]
    folder = package / "maps"  # in an installed wheel
    if not folder.is_dir():
        folder = package.parent / "maps"  # in a checkout
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}
