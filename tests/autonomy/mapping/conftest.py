"""Fixtures of a flat world for the tests of mapping."""

from flat_world import corridor, look, nowhere, room

__all__ = ["corridor", "look", "nowhere", "room"]
