"""Exploration: a robot builds a map, and chooses its targets on this map."""
