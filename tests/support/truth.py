"""What truly happens to robots, by a client that watches them all."""

import re
import socket
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Self

LINE = re.compile(
    r"SEE \{Robot (?P<robot>[^}]+)\} SEN \{Time (?P<time>[\d.]+)\}"
    r" \{Type GroundTruth\}.* \{Location (?P<x>[-\d.]+),(?P<y>[-\d.]+),"
)
STILL = 1e-4  # m between two readings of a robot at rest


@dataclass(frozen=True, slots=True)
class Place:
    """Where a robot is at a time of the simulation, s and m, map frame."""

    time: float
    x: float
    y: float

    def distance(self, other: Self) -> float:
        """Return the distance to another place, m."""
        return float(((self.x - other.x) ** 2 + (self.y - other.y) ** 2) ** 0.5)


class Truth:
    """Places of all robots of a server, as they come.

    Attributes:
        places: Places by robot, the newest last.
    """

    def __init__(self, address: tuple[str, int]) -> None:
        self.places: dict[str, list[Place]] = {}
        self._socket = socket.create_connection(address)
        self._socket.sendall(b"WATCH {Robots All}\r\n")
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Disconnect."""
        self._socket.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._socket.close()

    def last(self, robot: str) -> Place:
        """Return where a robot is; waits until that is known."""
        deadline = time.monotonic() + 240
        while not self.places.get(robot):
            assert time.monotonic() < deadline, f"{robot} is not seen"
            time.sleep(0.02)
        return self.places[robot][-1]

    def seconds_to_rest(self, robot: str, since: Place) -> float | None:
        """Return how long a robot moved after a place; None if it still moves."""
        later = [place for place in self.places[robot] if place.time >= since.time]
        for place, following in zip(later, later[5:], strict=False):
            if place.distance(following) < STILL:
                return place.time - since.time
        return None

    def _read(self) -> None:
        with (
            suppress(OSError),  # it was closed while more came
            self._socket.makefile(encoding="ascii", errors="replace") as lines,
        ):
            for line in lines:
                self._take(line)

    def _take(self, line: str) -> None:
        if found := LINE.match(line):
            x, y = float(found["x"]), -float(found["y"])  # on the wire, y is right
            place = Place(float(found["time"]), x, y)
            self.places.setdefault(found["robot"], []).append(place)
