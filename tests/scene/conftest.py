"""Fixtures for the tests of scenes."""

from map_texts import mesh_folder

__all__ = ["mesh_folder"]
