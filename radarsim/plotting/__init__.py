"""Plots of scans and of runs over a plan of the map."""

from radarsim.plotting.comparison import compare
from radarsim.plotting.plan import plot_scene
from radarsim.plotting.rendering import render
from radarsim.plotting.scans import (
    as_svg,
    draw_scans,
    draw_scene,
    plot_scan,
    plot_scans,
)

__all__ = [
    "as_svg",
    "compare",
    "draw_scans",
    "draw_scene",
    "plot_scan",
    "plot_scans",
    "plot_scene",
    "render",
]
