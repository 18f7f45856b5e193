"""Draws a teleoperated robot as text: a top view of its scan, and a panel of numbers.

The robot is in the centre of the view, facing up. Each Braille character provides two
by four dots, which serve as pixels.
"""

import math
from collections import deque
from itertools import groupby
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.client.robot_info import (
    RobotInfo,
    ScannerInfo,
    beam_angles,
    from_centre,
    same_name,
)
from radarsim.client.robot_state import RobotState
from radarsim.errors import escape_unprintable
from radarsim.geometry import Floats, Pose2, wrap_angle
from radarsim.protocol.reports import GroundTruth, Ins, Odometry, RangeScan, Report

Fragments: TypeAlias = list[tuple[str, str]]  # one line: pairs of style and text

DOTS_ACROSS: Final = 2
DOTS_DOWN: Final = 4
BRAILLE: Final = 0x2800  # the character without dots
BITS: Final = np.array([[1, 8], [2, 16], [4, 32], [64, 128]])
RADII: Final = (1, 2, 5, 10, 20, 50, 100)  # m, from the robot to the nearer edges
BARS: Final = (0.5, 1, 2, 5, 10, 20, 50, 100)  # m
LONGEST_BAR: Final = 1 / 3  # fraction of the width of the view
MIN_LENGTH: Final = 8  # dots; a shorter footprint is not drawn, only the arrow
NEAR: Final = 0.3  # m beyond the circle that a turning robot needs
MIDDLE: Final = 1.0  # m beyond the same circle
STYLES: Final = ("class:far", "class:middle", "class:near", "class:robot")
FAR_STYLE, MIDDLE_STYLE, NEAR_STYLE, ROBOT_STYLE = STYLES
SCALE_STYLE: Final = "class:scale"
WIDTH: Final = 31  # width of the panel, columns
WARNING: Final = "class:warning"
SILENCE_WARNING: Final = 0.6  # s; servers send a report at least every 0.2 s
RATE_SCANS: Final = 11  # number of scans over which the scan rate is measured
HELP: Final = "arrows or WASD drive  space stops  +/- speed  z/x zoom  q quits"
SHORTER_HELP: Final = (  # for narrow terminals; the key that quits is always included
    "WASD drive  space stops  +/- speed  q quits",
    "WASD drive  space stops  q quits",
    "space stops  q quits",
    "q quits",
)
POSE_ROWS: Final = (("INS", Ins), ("odometry", Odometry), ("truth", GroundTruth))


class DrivenRobot(RobotState):
    """The state of a teleoperated robot, and the scans of its displayed scanner.

    Attributes:
        robot_info: Properties of the robot.
        scanner: The displayed scanner.
        level: Name of the map.
        scan: The newest scan; None before the first.
    """

    def __init__(self, robot_info: RobotInfo, scanner: ScannerInfo, level: str) -> None:
        super().__init__()
        self.robot_info = robot_info
        self.scanner = scanner
        self.level = level
        self.scan: RangeScan | None = None
        self._scan_times: deque[float] = deque(maxlen=RATE_SCANS)

    def take(self, report: Report) -> bool:
        """Update the state by a report; ignore scans of scanners not displayed."""
        if isinstance(report, RangeScan):
            if not same_name(report.name, self.scanner.name):
                return False
            self.scan = report
            self._scan_times.append(report.time)
        return super().take(report)

    def points(self) -> Floats:
        """Return the positions at which beams of the newest scan hit an obstacle.

        Returns:
            (N, 2) x forward and y left from the robot's centre, m.
        """
        if self.scan is None:
            return np.zeros((0, 2))
        seen = self.scan.ranges > 0  # a blinded scanner reads 0
        bearings, ranges = from_centre(
            self.scan.ranges[seen],
            beam_angles(self.scan)[seen],
            self.scanner.mount,
            self.scanner.max_range,
        )
        ended = np.isfinite(ranges)
        bearings, ranges = bearings[ended], ranges[ended]
        return np.column_stack([ranges * np.cos(bearings), ranges * np.sin(bearings)])

    def is_blind(self) -> bool:
        """Return whether the scanner is blinded: no range in its scan is above 0."""
        return self.scan is not None and not (self.scan.ranges > 0).any()

    def scan_rate(self) -> float:
        """Return the scans per simulated second; NaN before the second scan."""
        times = self._scan_times
        elapsed = times[-1] - times[0] if times else 0.0
        return (len(times) - 1) / elapsed if elapsed > 0 else math.nan


class Canvas:
    """A drawing for a terminal, made of Braille dots in several styles."""

    def __init__(self, columns: int, rows: int, inks: tuple[str, ...]) -> None:
        """Create an empty canvas.

        Args:
            columns: Characters in a line, at least 1.
            rows: Lines, at least 1.
            inks: Styles in ascending priority. A cell takes the style of its dot with
                the highest priority.
        """
        self.columns = columns
        self.rows = rows
        self._styles = ("", *inks)
        self._dots = np.zeros((rows * DOTS_DOWN, columns * DOTS_ACROSS), dtype=np.int8)
        self._letters: dict[tuple[int, int], tuple[str, str]] = {}

    @property
    def height(self) -> int:
        """Height of the canvas in dots."""
        return self._dots.shape[0]

    @property
    def width(self) -> int:
        """Width of the canvas in dots."""
        return self._dots.shape[1]

    def plot(self, across: Floats, down: Floats, style: str) -> None:
        """Draw dots of one style at positions on the canvas.

        Args:
            across: (N,) distances from the left edge, dots; dots outside the canvas are
                ignored.
            down: (N,) distances from the upper edge, dots.
            style: One of the styles of the canvas.
        """
        # Positions outside are dropped as floats, because they may be too large for
        # an integer.
        inside = (across >= 0) & (across < self.width)
        inside &= (down >= 0) & (down < self.height)
        at = down[inside].astype(np.intp), across[inside].astype(np.intp)
        self._dots[at] = np.maximum(self._dots[at], self._styles.index(style))

    def write(self, row: int, column: int, text: str, style: str) -> None:
        """Write text on the canvas, over the dots; cut off text beyond the canvas."""
        for i, letter in enumerate(text, start=column):
            self._letters[row, i] = style, letter

    def lines(self) -> list[Fragments]:
        """Return the lines of text from the top, each as wide as the canvas."""
        shape = self.rows, DOTS_DOWN, self.columns, DOTS_ACROSS
        cells = self._dots.reshape(shape).transpose(0, 2, 1, 3)
        bits = ((cells > 0) * BITS).sum(axis=(2, 3))
        inks: NDArray[np.int8] = cells.max(axis=(2, 3))
        lines = []
        for row in range(self.rows):
            line: Fragments = []
            for column in range(self.columns):
                dots = bits[row, column]
                # A space replaces the empty Braille character, so that copied text
                # contains only plain spaces.
                braille = chr(BRAILLE + dots) if dots else " "
                drawn = self._styles[inks[row, column]], braille
                line.append(self._letters.get((row, column), drawn))
            # Neighbours of one style are joined, so fewer bytes go to the terminal.
            styles = groupby(line, key=lambda cell: cell[0])
            lines.append([(each, "".join(t for _, t in run)) for each, run in styles])
        return lines


def style_of(distance: float, clearance: float) -> str:
    """Return the style, such as red, for an obstacle at a distance from the robot.

    Args:
        distance: Distance from the robot's centre, m.
        clearance: Radius that the robot needs to turn, m.
    """
    free = distance - clearance
    if free < NEAR:
        return NEAR_STYLE
    return MIDDLE_STYLE if free < MIDDLE else FAR_STYLE


def draw_view(
    points: Floats, robot_info: RobotInfo, radius: float, columns: int, rows: int
) -> list[Fragments]:
    """Draw a top view of the robot and the obstacles around it as lines of text.

    Args:
        points: (N, 2) x forward and y left from the robot's centre, m.
        robot_info: Dimensions of the robot.
        radius: Radius of the view around the robot, m.
        columns: Characters in a line, at least 1.
        rows: Lines, at least 1.

    Returns:
        The lines from the top, each with ``columns`` characters.
    """
    canvas = Canvas(columns, rows, STYLES)
    dots_per_metre = min(canvas.width, canvas.height) / 2 / radius

    def plot(places: Floats, style: str) -> None:
        across = canvas.width / 2 - places[:, 1] * dots_per_metre
        down = canvas.height / 2 - places[:, 0] * dots_per_metre
        canvas.plot(across, down, style)

    free = np.hypot(points[:, 0], points[:, 1]) - robot_info.clearance
    near, middle = free < NEAR, free < MIDDLE
    plot(points[~middle], FAR_STYLE)
    plot(points[middle & ~near], MIDDLE_STYLE)
    plot(points[near], NEAR_STYLE)
    if robot_info.length * dots_per_metre >= MIN_LENGTH:
        longest = max(robot_info.length, robot_info.width)
        # Points on a side of the robot's outline are at most one dot apart.
        along = np.arange(-0.5, 0.5, 1 / (longest * dots_per_metre))
        half = np.full_like(along, 0.5)
        sides = [(along, half), (along, -half), (half, along), (-half, along)]
        outline = np.concatenate([np.column_stack(side) for side in sides])
        plot(outline * (robot_info.length, robot_info.width), ROBOT_STYLE)
    canvas.write(rows // 2, columns // 2, "▲", ROBOT_STYLE)
    canvas.write(rows - 1, 0, scale_bar(dots_per_metre, columns), SCALE_STYLE)
    return canvas.lines()


def scale_bar(dots_per_metre: float, columns: int) -> str:
    """Return the longest scale bar that fits into the view, with its length, as text.

    Args:
        dots_per_metre: Scale of the view, at which half the width shows at least 1 m.
        columns: Width of the view, characters.
    """
    most = columns * LONGEST_BAR * DOTS_ACROSS / dots_per_metre
    length = max(bar for bar in BARS if bar <= most)
    cells = max(round(length * dots_per_metre / DOTS_ACROSS), 2)
    return f"├{'─' * (cells - 2)}┤ {length:g} m "


def panel_lines(
    state: DrivenRobot,
    *,
    speed: float,
    commanded: tuple[float, float],
    silence: float,
) -> list[Fragments]:
    """Return the lines of the panel beside the view, which show the robot's state.

    Args:
        state: Newest state of the robot.
        speed: Driving speed that the keys adjust, m/s.
        commanded: Last commanded forward speed, m/s, and yaw rate, rad/s
            counter-clockwise.
        silence: Wall-clock time since the last report, s.

    Returns:
        Lines, none wider than ``WIDTH`` for numbers of usual size.
    """
    head = f"{state.robot_info.name}, {state.scanner.name}"
    battery = "-" if state.battery is None else state.battery
    touch = "", "no" if state.touched else "-"
    if any(state.touched.values()):
        touch = WARNING, "TOUCHING"
    plain = [
        escape_unprintable(state.level)[:WIDTH],
        escape_unprintable(head)[:WIDTH],
        "",
        f"time     {_number(state.time, 2)} s",
        f"scans    {_number(state.scan_rate(), 1)} /s",
        f"battery  {battery:>10}{'' if state.battery is None else ' s'}",
        "",
        f"speed    {speed:10.2f} m/s",
        f"ordered  {_motion(commanded)}",
        f"measured {_motion(state.motion())}",
        "",
        f"{'pose':9}{'x':>7}{'y':>7}{'yaw':>7}",
        *(f"{name:9}{_pose(state.poses.get(kind))}" for name, kind in POSE_ROWS),
        "",
    ]
    lines: list[Fragments] = [[("", line)] for line in plain]
    lines += [[("", "touch    "), touch], [("", "nearest  "), nearest(state)], []]
    return lines + [[(WARNING, text)] for text in warnings(state, silence)]


def help_text(width: int) -> str:
    """Return the longest text about the keys that fits into a width in characters.

    >>> help_text(40)
    'WASD drive  space stops  q quits'
    """
    fitting = (text for text in (HELP, *SHORTER_HELP) if len(text) <= width)
    return next(fitting, SHORTER_HELP[-1][:width])


def nearest(state: DrivenRobot) -> tuple[str, str]:
    """Return distance and bearing of the nearest obstacle as text, after its style."""
    points = state.points()
    if not len(points):
        return "", "nothing seen"
    distances = np.hypot(points[:, 0], points[:, 1])
    i = int(distances.argmin())
    text = f"{distances[i]:.2f} m, {bearing(math.atan2(points[i, 1], points[i, 0]))}"
    return style_of(float(distances[i]), state.robot_info.clearance), text


def bearing(angle: float) -> str:
    """Describe a bearing, rad counter-clockwise from the front, in words.

    >>> bearing(-0.7), bearing(3.14)
    ('40° right', 'behind')
    """
    degrees = math.degrees(wrap_angle(angle))
    size = round(abs(degrees))
    if size == 0:
        return "ahead"
    if size == 180:
        return "behind"
    return f"{size}° {'left' if degrees > 0 else 'right'}"


def warnings(state: DrivenRobot, silence: float) -> list[str]:
    """Return texts that warn the driver, such as of an empty battery."""
    texts = []
    if silence > SILENCE_WARNING:
        texts.append(f"server silent for {silence:.1f} s")
    if state.scan is None:
        texts.append("no scan yet")
    elif state.is_blind():
        texts.append("scanner blinded: reads 0")
    if state.battery == 0:
        texts.append("battery empty")
    return texts


def _pose(pose: Pose2 | None) -> str:
    if pose is None:
        return f"{'-':>7}{'-':>7}{'-':>7}"
    return f"{pose.x:7.2f}{pose.y:7.2f}{math.degrees(wrap_angle(pose.yaw)):6.0f}°"


def _motion(motion: tuple[float, float] | None) -> str:
    if motion is None:
        return f"{'-':>10}"
    # Adding 0 converts -0 to 0, so that the panel shows no minus sign before 0.
    speed, turn = round(motion[0], 2) + 0.0, round(math.degrees(motion[1])) + 0
    return f"{speed:10.2f} m/s{turn:4d}°/s"


def _number(value: float, digits: int) -> str:
    return f"{'-':>10}" if math.isnan(value) else f"{value:10.{digits}f}"
