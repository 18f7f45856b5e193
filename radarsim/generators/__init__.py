"""Generators of scenes by seed: random maps for trials, and plants."""
