"""Experiments: sweeps."""
