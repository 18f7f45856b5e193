"""The host that a test asks for.

Apart from the fixtures, because it imports the engine, Embree and shapely.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from types import UnionType
from typing import Any

from radarsim.protocol.dialect import get_dialect
from radarsim.scene.map_file import load_map
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig


def make_host(options: dict[str, Any]) -> Host:
    """Create the host for the options of a test.

    Raises:
        RadarsimError: If the map or the settings are wrong.
        ValueError: If another option is, or is of another type.
    """
    _check_types(options)
    seed, speed = options["seed"], options["speed"]
    if seed < 0:
        raise ValueError(f"seed {seed}, expected at least 0")
    if not 0 < speed < math.inf:
        raise ValueError(f"speed {speed}, expected above 0")
    dialect = get_dialect(options["dialect"])
    scene = load_map(options["map"])
    config = SimulationConfig(dialect, item_settings=options["settings"])
    return Host(scene, config=config, seed=seed)


def _check_types(options: dict[str, Any]) -> None:
    """Check that the options of a mark have the types that they should have.

    Raises:
        ValueError: If one does not.
    """
    settings = options["settings"]
    by_item = settings.values() if isinstance(settings, Mapping) else [None]
    are_known = {
        "map": (isinstance(options["map"], str | Path), "a name or a path"),
        "seed": (_is_number(options["seed"], int), "an integer"),
        "dialect": (isinstance(options["dialect"], str), "'compat' or 'udk'"),
        "speed": (_is_number(options["speed"], int | float), "a number above 0"),
        "settings": (
            all(isinstance(each, Mapping) for each in by_item),
            "settings by item, as {'lms200': {'max_range': 20}}",
        ),
    }
    for name, (is_known, expected) in are_known.items():
        if not is_known:
            came = repr(options[name])[:80]
            raise ValueError(f"{name} {came}, expected {expected}")


def _is_number(value: object, kind: type | UnionType) -> bool:
    return isinstance(value, kind) and not isinstance(value, bool)
