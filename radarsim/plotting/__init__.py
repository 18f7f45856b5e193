"""Plots of scenes and of scans, drawn over a plan of the map."""
