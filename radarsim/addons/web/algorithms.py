"""The tasks of robots, to drive to a goal or to explore, and maps of their scans.

The functions block, so they run in threads. They report progress as messages.
"""

import base64
import io
import logging
import math
import queue
import threading
import time
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from radarsim.addons.web.own_robot import RobotClient, Send
from radarsim.addons.web.requests import BadRequest, Colours, Explore, Goto, Map
from radarsim.addons.web.robot_view import RobotView
from radarsim.autonomy.exploration.exploration import Exploration, Outcome
from radarsim.autonomy.mapping.export import (
    COMMANDER_CELLS,
    commander_pixels,
    sensed_window,
)
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.mapping.occupancy_grid import OccupancyGrid
from radarsim.autonomy.navigation.mission import run_mission
from radarsim.autonomy.navigation.run_log import RunLog
from radarsim.autonomy.navigation.runner import NavigationStep
from radarsim.autonomy.plans import ExplorationPlan, Mission
from radarsim.autonomy.plotting.maps import CELLS, SHADES
from radarsim.client import ScannerInfo
from radarsim.client.robot_info import same_name
from radarsim.errors import RadarsimError
from radarsim.geometry import Floats, Pose2
from radarsim.protocol.reports import Report
from radarsim.rng import generator_for

log = logging.getLogger("radarsim.addons.web")
PATH_INTERVAL: Final = 0.5  # s between two messages with a path
MAP_INTERVAL: Final = 1.0  # s between two messages with a map
MOST_POINTS: Final = 1000  # points of a path in a message
MOST_WAITING: Final = 2000  # reports that wait to be mapped; others are dropped
HERE: Final = Pose2(0.0, 0.0)  # not used, because the robot is spawned already


def _every(interval: float) -> Callable[[], bool]:
    """Return a function that is true at most once in ``interval`` s of wall time."""
    due = -math.inf

    def is_due() -> bool:
        nonlocal due
        now = time.monotonic()
        has_passed = now >= due
        if has_passed:
            due = now + interval
        return has_passed

    return is_due


def drive_to_goal(
    request: Goto, safety_distance: float | None, client: RobotClient, send: Send
) -> str:
    """Drive to a goal, and send the path while the robot drives.

    Args:
        request: Algorithm and goal.
        safety_distance: m; None for the smallest distance that suits the robot.
        client: The client of the robot.
        send: Called with messages.

    Returns:
        The goal, the time and the length of the path, as a text.

    Raises:
        RadarsimError: If the goal is not reached.
    """
    mission = Mission(
        algorithm=request.algorithm,
        goals=(request.goal,),
        heading=request.heading,
        pose=HERE,
        safety_distance=safety_distance,
        time_limit=math.inf,
    )
    run_log, is_due = RunLog(), _every(PATH_INTERVAL)

    def send_path() -> None:
        path = describe_path(request.robot, run_log.path)
        marks = {"hits": run_log.hit_points, "leaves": run_log.leave_points}
        aim = {"goal": request.goal, "heading": request.heading}
        send({**path, **marks, **aim})

    def observe(step: NavigationStep) -> None:
        run_log.add(step)
        if is_due():
            send_path()

    try:
        result = run_mission(client, mission, observe)
    finally:
        # Send the latest path even if the drive fails.
        send_path()
    if result.outcome != "reached":
        no_path = result.outcome == "no_path"
        raise RadarsimError("there is no path" if no_path else result.outcome)
    return f"{request}, in {result.time:.0f} s, {result.path_length:.1f} m"


def explore(request: Explore, colours: Colours, client: RobotClient, send: Send) -> str:
    """Explore, and send the path and the map while the robot drives.

    Args:
        request: The strategy.
        colours: Colours of the map.
        client: The client of the robot.
        send: Called with messages.

    Returns:
        The time and the length of the path, as a text.

    Raises:
        RadarsimError: If the exploration ends before the area is explored.
    """
    plan = ExplorationPlan(strategy=request.strategy, pose=HERE)
    exploration = Exploration(plan, generator_for(0, request.robot))
    is_path_due, is_map_due = _every(PATH_INTERVAL), _every(MAP_INTERVAL)

    def show(*, path: bool, grid: bool) -> None:
        mapper = exploration.mapper
        if mapper is None or not mapper.scans:
            return
        if path:
            send(describe_path(request.robot, mapper.trajectory.rows()))
        if grid:
            send(describe_map(request.robot, mapper.grid, colours))

    try:
        exploration.run(client, lambda _: show(path=is_path_due(), grid=is_map_due()))
    finally:
        show(path=True, grid=True)
    outcome, trip = exploration.outcome, exploration.trip
    if outcome is not Outcome.EXPLORED:
        raise RadarsimError(outcome.value.replace("_", " "))
    return f"explored in {trip.time:.0f} s, {trip.length:.1f} m"


def describe_path(robot: str, path: Floats) -> dict[str, Any]:
    """Return the message ``path``; a long path is thinned to evenly spread points.

    Args:
        robot: Name of the robot.
        path: Points, (N, 2) or more columns; x and y in m, map frame.
    """
    step = max(1, math.ceil(len(path) / MOST_POINTS))
    # The last point is always kept, because it is the position of the robot.
    last = path[-1:] if len(path) and (len(path) - 1) % step else path[:0]
    points = np.concatenate([path[::step], last])[:, :2]
    return {
        "op": "path",
        "robot": robot,
        "points": np.round(points, 3).tolist(),
        "hits": [],
        "leaves": [],
        "goal": None,
        "heading": None,
    }


def describe_map(robot: str, grid: OccupancyGrid, colours: Colours) -> dict[str, Any]:
    """Return the message ``map``: a PNG of the sensed part of a map, and its position.

    The first row of the picture is the northernmost; ``origin`` is the south-western
    corner, m, map frame. ``legend`` has the meaning of each colour in the picture.

    Args:
        robot: Name of the robot that made the map.
        grid: The map, which contains at least one scan.
        colours: Either the colours of UsarCommander, or the colours of the materials.
    """
    rows, columns = sensed_window(grid)
    x, y = grid.frame.origin
    size = grid.frame.resolution
    if colours == "usarcommander":
        pixels = commander_pixels(grid)[rows, columns]
        legend = [[f"#{bytes(c).hex()}", text] for text, c in COMMANDER_CELLS.items()]
    else:
        pixels = SHADES[grid.classes()[rows, columns]]
        legend = [[*each] for each in CELLS.values()]
    data = io.BytesIO()
    # The first row of a picture is at the top, the first row of a map in the south.
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
        "legend": [each for each in legend if _is_in(each[0], pixels)],
        "png": base64.b64encode(data.getvalue()).decode(),
    }


def _is_in(colour: str, pixels: NDArray[np.uint8]) -> bool:
    rgb = np.frombuffer(bytes.fromhex(colour[1:]), np.uint8)
    return bool((pixels == rgb).all(axis=-1).any())


class MapMaker:
    """Makes a map from the scans of one scanner of a robot.

    Attributes:
        colours: Colours of the pictures.
    """

    def __init__(
        self, robot: RobotView, request: Map, send: Send, *, has_echoes: bool
    ) -> None:
        """Start to map in a thread.

        Args:
            robot: The robot, whose reports are mapped until ``stop``.
            request: The scanner to map with, and the colours.
            send: Called with messages, in the thread.
            has_echoes: Whether the server sends the echoes of the scanner.

        Raises:
            BadRequest: If the robot has no such scanner, or has not scanned yet.
        """
        self.colours = request.colours
        self._robot = robot
        self._send = send
        self._mapper = Mapper(
            _choose_scanner(robot, request.scanner),
            echo_wait=1.0 if has_echoes else 0.0,
            robot_radius=min(robot.size) / 2,
            clock=time.monotonic,
        )
        # None ends the thread. A queue is needed, as reports may arrive faster than the
        # mapper processes them.
        self._reports: queue.Queue[Report | None] = queue.Queue()
        robot.listeners.append(self._take)
        threading.Thread(target=self._run, daemon=True).start()

    def stop(self) -> None:
        """Stop mapping."""
        if self._take in self._robot.listeners:
            self._robot.listeners.remove(self._take)
        self._reports.put(None)

    def _take(self, report: Report) -> None:
        if self._reports.qsize() < MOST_WAITING:
            self._reports.put(report)

    def _run(self) -> None:
        shown, is_due = 0, _every(MAP_INTERVAL)
        try:
            while (report := self._reports.get()) is not None:
                self._mapper.take(report)
                if self._mapper.scans > shown and is_due():
                    shown = self._mapper.scans
                    grid = self._mapper.grid
                    self._send(describe_map(self._robot.name, grid, self.colours))
        except RadarsimError as error:
            log.warning("mapping with %s ended: %s", self._robot.name, error)


def _choose_scanner(robot: RobotView, name: str | None) -> ScannerInfo:
    """Return the named scanner; without a name, the first radar, or any scanner."""
    seen = [each.scan for each in robot.scans.values()]
    if name is not None:
        seen = [scan for scan in seen if same_name(scan.name, name)]
    seen.sort(key=lambda scan: robot.scanner(scan.name).medium != "radar")
    if not seen:
        wanted = "any scanner" if name is None else f"the scanner {name!r}"
        raise BadRequest(f"no scan of {wanted} of {robot.name!r} has arrived yet")
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
