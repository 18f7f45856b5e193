"""Plots and films of robot runs and of the maps that robots build."""
