"""Generates scenes from seeds: random maps for trials of navigators."""
