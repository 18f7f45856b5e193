"""Generates random maps from seeds, for trials of navigators."""
