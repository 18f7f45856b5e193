"""Generators of scenes by seed: random maps for trials, plants, and a town."""
