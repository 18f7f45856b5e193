"""What a shell completes: names of maps, sensors and robot classes, quickly.

Nothing that compiles is imported: a shell asks whenever Tab is pressed.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path


def complete_map(incomplete: str) -> Iterator[str]:
    """Yield names of shipped maps, and map files."""
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


def complete_sensor(incomplete: str) -> Iterator[str]:
    """Yield names of presets of sensors."""
    from radarsim.presets.preset_files import preset_names

    return _beginning(incomplete, preset_names("sensors"))


def complete_robot(incomplete: str) -> Iterator[str]:
    """Yield names of robot classes."""
    from radarsim.presets.preset_files import preset_names

    return _beginning(incomplete, preset_names("robots"))


def _beginning(incomplete: str, names: Iterable[str]) -> Iterator[str]:
    return (name for name in sorted(names) if name.startswith(incomplete))
