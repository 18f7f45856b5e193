"""Packages that radarsim does not need, but can use."""

import importlib
from typing import Any

from radarsim.errors import MissingPackage


def import_optional(name: str, extra: str) -> Any:
    """Import and return a module of an extra.

    Args:
        name: Name of the module.
        extra: The extra of radarsim that installs its package.

    Raises:
        MissingPackage: If it is not installed; it names the extra.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        package = name.partition(".")[0]
        text = f"{package} is not installed, expected: pip install 'radarsim[{extra}]'"
        raise MissingPackage(text) from error
