"""Exploration: a robot chooses its targets on the map that it builds."""
