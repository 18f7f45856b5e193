"""Sweeps: the same task for all combinations of parameters, as one table."""
