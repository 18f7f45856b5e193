"""The one door from values such as scenes and scans to their pictures."""

import importlib
from typing import Any


def load_plotting() -> Any:
    """Import and return ``radarsim.plotting``.

    It lies above the layers that call this, and matplotlib is slow to import. So the
    import waits for the first picture, and is by name, which no layer depends on.
    """
    return importlib.import_module("radarsim.plotting")
