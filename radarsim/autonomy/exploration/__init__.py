"""Exploration: a robot decides by the map so far where to drive next."""
