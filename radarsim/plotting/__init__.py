"""Pictures of scans over a plan of the map."""

from radarsim.plotting.scans import draw_scans, figure_of

__all__ = ["draw_scans", "figure_of"]
