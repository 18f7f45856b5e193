"""Fixtures of a flat world for the tests of navigators."""

from flatland import flatland

__all__ = ["flatland"]
