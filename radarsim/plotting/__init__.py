"""Plots of scans and of runs over a plan of the map."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from radarsim.addons.fmcw.plots import draw_spectrum, plot_spectrum
    from radarsim.plotting.comparison import compare
    from radarsim.plotting.plan import plot_scene
    from radarsim.plotting.scans import (
        as_svg,
        draw_scans,
        draw_scene,
        plot_scan,
        plot_scans,
    )
    from radarsim.plotting.style import render

# Modules are imported on first use: colours alone do not need all that draws.
_MODULES = {
    "as_svg": "scans",
    "compare": "comparison",
    "draw_scans": "scans",
    "draw_scene": "scans",
    "draw_spectrum": "radarsim.addons.fmcw.plots",
    "plot_scan": "scans",
    "plot_scans": "scans",
    "plot_scene": "plan",
    "plot_spectrum": "radarsim.addons.fmcw.plots",
    "render": "style",
}

__all__ = [
    "as_svg",
    "compare",
    "draw_scans",
    "draw_scene",
    "draw_spectrum",
    "plot_scan",
    "plot_scans",
    "plot_scene",
    "plot_spectrum",
    "render",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = _MODULES[name]
    module = importlib.import_module(home if "." in home else f"{__name__}.{home}")
    return getattr(module, name)


def __dir__() -> list[str]:
    return __all__
