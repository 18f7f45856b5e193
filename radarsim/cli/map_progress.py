"""What a person is told on stderr while a map is made."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

import numpy as np

from radarsim.cli.progress import Lines, living
from radarsim.mapping.mapper import Mapper
from radarsim.navigation.runner import TripMeter


class Mapping(Protocol):
    """A map in the making."""

    @property
    def mapper(self) -> Mapper | None:
        """Has the map; None before the first scan."""

    @property
    def trip(self) -> TripMeter:
        """How far the robot has come."""


class Teller(Protocol):
    """Tells of a map as it grows."""

    def tell(self, activity: str) -> None:
        """Take notice of a scan, and of what the robot is at."""


@contextmanager
def progress(mapping: Mapping) -> Iterator[Teller]:
    """Tell of a map, by one living line on a terminal, else by a line per change."""
    now = Now(mapping)
    with living(now.present) as lines:
        yield now if lines is None else Changes(lines, mapping)


class Now:
    """Knows what the robot is at, for a line that lives."""

    def __init__(self, mapping: Mapping) -> None:
        self._mapping = mapping
        self._activity = "waiting for a scan"

    def tell(self, activity: str) -> None:
        """Take notice."""
        self._activity = activity

    def present(self) -> str:
        """Say how things stand."""
        return present(self._mapping, self._activity)


class Changes:
    """A line for every change of what the robot is at."""

    def __init__(self, lines: Lines, mapping: Mapping) -> None:
        self._lines = lines
        self._mapping = mapping
        self._before = ""

    def tell(self, activity: str) -> None:
        """Print a line if something has changed."""
        if activity == self._before:
            return
        self._before = activity
        self._lines.add(present(self._mapping, activity))


def present(mapping: Mapping, activity: str) -> str:
    """Say in one line how things stand."""
    mapper, trip = mapping.mapper, mapping.trip
    if mapper is None or not mapper.scans:
        return activity
    area = f"sensed {sensed_area(mapper):7.1f} m²"
    path = f"path {trip.length:6.2f} m"
    return f"{trip.time:8.1f} s  {activity:9}  {path}  {area}"


def sensed_area(mapper: Mapper) -> float:
    """Give the area that beams have been in, m²."""
    cells = int(np.count_nonzero(mapper.grid.sensed_cells()))
    return cells * mapper.grid.frame.resolution**2
