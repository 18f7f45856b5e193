"""Plots and films of runs and of maps that robots made."""
