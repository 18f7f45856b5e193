"""The town of ``examples/town``, a script that is no part of the package."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "town"))

from town import GROUND, PAVEMENT, ROADWAY, town_yaml
from town_objects import SIDE

__all__ = ["GROUND", "PAVEMENT", "ROADWAY", "SIDE", "town_yaml"]
