"""Plots of scans and of runs over a plan of the map."""

from radarsim.plotting.plan import plot_scene
from radarsim.plotting.scans import draw_scan, draw_scans, plot_scans

__all__ = ["draw_scan", "draw_scans", "plot_scans", "plot_scene"]
