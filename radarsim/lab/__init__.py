"""Experiments: a study and sweeps."""
