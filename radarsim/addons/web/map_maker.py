"""A map of what one scanner of a robot senses, whoever drives it; made in a thread.

Maps as messages: a picture of what is sensed, and where it belongs.
"""

import base64
import io
import logging
import queue
import threading
import time
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from matplotlib.colors import to_rgb
from PIL import Image

from radarsim.addons.web.requests import BadRequest, Colours
from radarsim.addons.web.robot_view import RobotView
from radarsim.autonomy.mapping.export import commander_pixels, sensed_window
from radarsim.autonomy.mapping.mapper import Mapper, MapperSettings
from radarsim.autonomy.mapping.occupancy_grid import CellClass, OccupancyGrid
from radarsim.autonomy.mapping.slam import SlamSettings
from radarsim.autonomy.plotting.maps import CELL_COLOURS
from radarsim.client import ScannerInfo
from radarsim.client.robot_info import same_name
from radarsim.errors import RadarsimError
from radarsim.protocol.reports import Report

_SHADES: Final = np.array(
    [[round(255 * part) for part in to_rgb(CELL_COLOURS[each])] for each in CellClass],
    np.uint8,
)


def describe_map(robot: str, grid: OccupancyGrid, colours: Colours) -> dict[str, Any]:
    """Return the message ``map``.

    The first row of the picture is the northernmost; ``origin`` is the south-western
    corner, m, map frame.

    Args:
        robot: Name of the robot that it is a map of.
        grid: The map, which has taken in a scan.
        colours: Those of UsarCommander, or those of the materials.
    """
    rows, columns = sensed_window(grid)
    x, y = grid.frame.origin
    size = grid.frame.resolution
    if colours == "usarcommander":
        pixels = commander_pixels(grid)[rows, columns]
    else:
        pixels = _SHADES[grid.classes()[rows, columns]]
    data = io.BytesIO()
    Image.fromarray(np.flip(pixels, axis=0)).save(data, "png")
    height, width = pixels.shape[:2]
    return {
        "op": "map",
        "robot": robot,
        "resolution": size,
        "origin": [x + columns.start * size, y + rows.start * size],
        "width": width,
        "height": height,
        "colours": colours,
        "png": base64.b64encode(data.getvalue()).decode(),
    }


log = logging.getLogger("radarsim.addons.web")
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
