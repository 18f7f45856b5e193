"""A map of what one scanner of a robot senses, whoever drives it; made in a thread."""

import logging
import queue
import threading
import time
from collections.abc import Callable
from typing import Any, Final

from radarsim.client import ScannerInfo
from radarsim.client.robot_info import same_name
from radarsim.commander.map_picture import describe_map
from radarsim.commander.requests import BadRequest, Colours
from radarsim.commander.robot_view import RobotView
from radarsim.errors import RadarsimError
from radarsim.mapping.mapper import Mapper, MapperSettings
from radarsim.mapping.slam import SlamSettings
from radarsim.protocol.reports import Report

log = logging.getLogger("radarsim.commander")
INTERVAL: Final = 1.0  # s between two pictures
MOST_WAITING: Final = 2000  # reports; beyond it new ones are lost


class MapMaker:
    """Makes a map of one robot.

    Attributes:
        colours: Colours of the pictures.
    """

    def __init__(
        self,
        robot: RobotView,
        scanner: ScannerInfo,
        colours: Colours,
        tell: Callable[[dict[str, Any]], None],
        *,
        has_echoes: bool,
    ) -> None:
        """Start.

        Args:
            robot: The robot, whose reports it takes until it is stopped.
            scanner: The scanner to map with.
            colours: Colours of the pictures.
            tell: Called with messages, in the maker's thread.
            has_echoes: Whether the echoes of the scanner are told.
        """
        self.colours = colours
        self._robot = robot
        self._tell = tell
        settings = MapperSettings(
            slam=SlamSettings(motion_source="ins"),
            echo_wait=1.0 if has_echoes else 0.0,
            robot_radius=min(robot.size) / 2,
        )
        self._mapper = Mapper(scanner, settings, clock=time.monotonic)
        self._reports: queue.Queue[Report | None] = queue.Queue()
        robot.listeners.append(self._take)
        threading.Thread(target=self._run, daemon=True).start()

    def stop(self) -> None:
        """End the map."""
        if self._take in self._robot.listeners:
            self._robot.listeners.remove(self._take)
        self._reports.put(None)

    def _take(self, report: Report) -> None:
        if self._reports.qsize() < MOST_WAITING:
            self._reports.put(report)

    def _run(self) -> None:
        try:
            self._make()
        except RadarsimError as error:
            log.warning("the map of %s ends: %s", self._robot.name, error)

    def _make(self) -> None:
        shown, due = 0, 0.0
        while (report := self._reports.get()) is not None:
            self._mapper.take(report)
            now = time.monotonic()
            if self._mapper.scans > shown and now >= due:
                shown, due = self._mapper.scans, now + INTERVAL
                grid = self._mapper.grid
                self._tell(describe_map(self._robot.name, grid, self.colours))


def choose_scanner(robot: RobotView, name: str | None) -> ScannerInfo:
    """Return the scanner to map with.

    Args:
        robot: The robot.
        name: Name of the scanner; None for the first radar, or else the first one.

    Raises:
        BadRequest: If it has no such scanner, or it has not scanned yet.
    """
    seen = [scans[-1].scan for scans in robot.scans.values()]
    if name is not None:
        seen = [scan for scan in seen if same_name(scan.name, name)]
    seen.sort(key=lambda scan: robot.scanner(scan.name).medium != "radar")
    if not seen:
        wanted = "any scanner" if name is None else f"the scanner {name!r}"
        raise BadRequest(f"no scan of {wanted} of {robot.name!r} has come yet")
    scan, gaps = seen[0], len(seen[0].ranges) - 1
    scanner = robot.scanner(scan.name)
    return ScannerInfo(
        scan.name,
        scanner.mount,
        min_range=float(scanner.settings.get("min_range", 0.0)),
        max_range=scanner.max_range,
        resolution=scan.fov / gaps if gaps else scan.resolution,
        fov=scan.fov,
        beams=gaps + 1,
    )
