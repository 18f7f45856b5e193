"""Plots of scans and of runs over a plan of the map."""

from radarsim.plotting.scans import draw_scans, plot_scans

__all__ = ["draw_scans", "plot_scans"]
