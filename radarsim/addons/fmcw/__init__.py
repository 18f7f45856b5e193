"""Simulates rotating FMCW radars: traces rays, and computes the power in range bins."""
