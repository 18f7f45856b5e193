"""Experiments: figures of the thesis, a study, sweeps."""
