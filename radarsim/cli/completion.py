"""Shell completion for names of maps, sensors and robot classes.

A shell runs the program each time that the user presses Tab, so this module imports no
large packages.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Literal


def complete_map(incomplete: str) -> Iterator[str]:
    """Yield names of shipped maps, folders and map files that begin with the input."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "maps", package.parent / "maps"):
        yield from _beginning(incomplete, (p.stem for p in folder.glob("*.yaml")))
    start = Path(incomplete)
    folder = start if incomplete.endswith("/") else start.parent
    for path in sorted(folder.glob("*")):
        if path.is_dir():
            yield from _beginning(incomplete, [f"{path}/"])
        elif path.suffix in (".yaml", ".yml"):
            yield from _beginning(incomplete, [str(path)])


def complete_words(
    kind: Literal["maps", "sensors", "robots"], incomplete: str
) -> Iterator[str]:
    """Return the names of maps, sensors or robots that begin with the input."""
    if kind == "maps":
        return complete_map(incomplete)
    from radarsim.presets import preset_names

    return _beginning(incomplete, preset_names(kind))


def _beginning(incomplete: str, names: Iterable[str]) -> Iterator[str]:
    return (name for name in sorted(names) if name.startswith(incomplete))
