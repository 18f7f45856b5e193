"""Plots of scenes and scans over a plan of the map."""
