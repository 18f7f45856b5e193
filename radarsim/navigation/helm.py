"""Scans in, wheel speeds out, and a robot that is stopped when in doubt.

Where scans stay away the robot is stopped first, and given up a little later with a
word on what was missing.
"""

from collections.abc import Iterator
from typing import Protocol

from radarsim.client import Client, RobotFacts, ScannerFacts
from radarsim.errors import ClientError, ClientTimeout
from radarsim.navigation.motion import STAND, Motion
from radarsim.navigation.sensed import Sensed
from radarsim.protocol.reports import Report

STOP_AFTER = 0.5  # s without a scan after which the robot is stopped


def check_beams(count: int, scanner: ScannerFacts) -> None:
    """Refuse a scan of so few beams that some bumper may see nothing.

    Args:
        count: How many it has.
        scanner: That it is of.

    Raises:
        ClientError: If it has less than half of what the server told.
    """
    if count < scanner.beams / 2:
        text = f"scan of {count} ranges from {scanner.name[:80]!r}"
        raise ClientError(f"{text}, expected {scanner.beams}")


class Lookout(Protocol):
    """Puts reports together to what is known of the surroundings."""

    @property
    def missing(self) -> str:
        """What it waits for."""

    def take(self, report: Report) -> Sensed | None:
        """Take in a report; give what is known if it completes that."""


class Helm:
    """Steers one robot by what a lookout sees."""

    def __init__(
        self, client: Client, facts: RobotFacts, lookout: Lookout, *, timeout: float
    ) -> None:
        """Get ready.

        Args:
            client: The connection; its robot is spawned.
            facts: Of the robot.
            lookout: Is shown every report.
            timeout: After so many s without a scan the run is given up.
        """
        self._client = client
        self._facts = facts
        self._lookout = lookout
        self._timeout = timeout

    def drive(self, motion: Motion) -> None:
        """Set the wheels to a motion."""
        self._client.drive(*self._facts.wheel_speeds(motion.speed, motion.turn))

    def scans(self) -> Iterator[Sensed]:
        """Give what is known at every scan; stops the robot while none comes.

        Raises:
            ClientError: If none comes any more.
        """
        while True:
            yield self._next()

    def _next(self) -> Sensed:
        clock = self._client.link.time
        began, stopped = clock(), False
        came: set[str] = set()
        while (waited := clock() - began) < self._timeout:
            if waited >= STOP_AFTER and not stopped:
                self.drive(STAND)
                stopped = True
            reports = self._read((self._timeout if stopped else STOP_AFTER) - waited)
            newest = None
            for report in reports:
                newest = self._lookout.take(report) or newest
                came.add(type(report).__name__)
            if newest is not None:
                return newest
        told = f"what came: {', '.join(sorted(came))}" if came else "nothing came"
        missing = f"no {self._lookout.missing} within {self._timeout:g} s"
        raise ClientError(f"{missing}, {told}; the robot was told to stop")

    def _read(self, timeout: float) -> list[Report]:
        try:
            return self._client.read(max(timeout, 0.001))
        except ClientTimeout:
            return []
