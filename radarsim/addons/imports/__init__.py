"""Imports maps and robot classes from files of other programs."""
