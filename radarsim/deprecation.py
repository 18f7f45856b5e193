"""Old public names, which work for one more version and warn when they are used.

__getattr__ = deprecated_names(__name__, {"Old": "radarsim.scene.scene.New"})
"""

import importlib
import warnings
from collections.abc import Callable, Mapping
from typing import Any


def deprecated_names(
    module: str, renamed: Mapping[str, str], *, stacklevel: int = 2
) -> Callable[[str], Any]:
    """Return a ``__getattr__`` for a module that finds renamed objects.

    Args:
        module: Name of the module that has the old names.
        renamed: Full new name, module and object, by old name.
        stacklevel: Stack level of the warning; 3 where another function calls the
            returned one.
    """

    def find(name: str) -> Any:
        if name not in renamed:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        home, _, new_name = renamed[name].rpartition(".")
        text = f"{module}.{name} is deprecated, expected {renamed[name]}"
        warnings.warn(text, DeprecationWarning, stacklevel=stacklevel)
        return getattr(importlib.import_module(home), new_name)

    return find


def warn_renamed(old: str, new: str) -> None:
    """Warn the caller's caller that a name has been replaced.

    >>> import pytest
    >>> with pytest.warns(DeprecationWarning, match="Client.link is deprecated"):
    ...     warn_renamed("Client.link", "Client.transport")
    """
    warnings.warn(
        f"{old} is deprecated, use {new}", category=DeprecationWarning, stacklevel=3
    )
