"""The text panel beside the view."""

import math
from typing import Final

import numpy as np

from radarsim.geometry import Pose2, wrap_angle
from radarsim.printable_text import escape_unprintable
from radarsim.protocol.reports import GroundTruth, Ins, Odometry
from radarsim.teleop.robot_state import RobotState
from radarsim.teleop.view import Fragments, style_of

WIDTH: Final = 31  # columns
WARNING: Final = "class:warning"
SILENCE_WARNING: Final = (
    0.6  # s without reports from the server, which sends some every 0.2 s
)
HELP: Final = "arrows or WASD drive  space stops  +/- speed  z/x zoom  q quits"
SHORTER_HELP: Final = (  # for narrow terminals: how to end is the last to go
    "WASD drive  space stops  +/- speed  q quits",
    "WASD drive  space stops  q quits",
    "space stops  q quits",
    "q quits",
)
POSE_ROWS: Final = (("INS", Ins), ("odometry", Odometry), ("truth", GroundTruth))


def panel_lines(
    state: RobotState,
    *,
    speed: float,
    commanded: tuple[float, float],
    silence: float,
) -> list[Fragments]:
    """Format the state of the robot.

    Args:
        state: Newest state of the robot.
        speed: Speed that the keys set, m/s.
        commanded: The motion commanded last: m/s ahead, rad/s counter-clockwise.
        silence: Wall-clock time since the last report, s.

    Returns:
        Lines, none wider than ``WIDTH`` for numbers of usual size.
    """
    head = f"{state.robot_info.name}, {state.scanner.name}"
    plain = [
        escape_unprintable(state.level)[:WIDTH],
        escape_unprintable(head)[:WIDTH],
        "",
        f"time     {_number(state.time, 10, 2)} s",
        f"scans    {_number(state.scan_rate(), 10, 1)} /s",
        f"battery  {_battery(state.battery)}",
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
    lines += [[("", "touch    "), _touch(state)]]
    lines += [[("", "nearest  "), nearest(state)], []]
    return lines + [[(WARNING, text)] for text in warnings(state, silence)]


def help_text(width: int) -> str:
    """Return as much help as fits in some columns.

    >>> help_text(40)
    'WASD drive  space stops  q quits'
    """
    fitting = (text for text in (HELP, *SHORTER_HELP) if len(text) <= width)
    return next(fitting, SHORTER_HELP[-1][:width])


def nearest(state: RobotState) -> tuple[str, str]:
    """Return the style and text for distance and direction of the nearest obstacle."""
    points = state.points()
    if not len(points):
        return "", "nothing seen"
    distances = np.hypot(points[:, 0], points[:, 1])
    i = int(distances.argmin())
    text = f"{distances[i]:.2f} m, {bearing(math.atan2(points[i, 1], points[i, 0]))}"
    return style_of(float(distances[i]), state.robot_info.clearance), text


def bearing(angle: float) -> str:
    """Return a direction in words, from rad counter-clockwise from the front.

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


def warnings(state: RobotState, silence: float) -> list[str]:
    """Return what the driver should know at once."""
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


def _touch(state: RobotState) -> tuple[str, str]:
    if not state.touched:
        return "", "-"
    return (WARNING, "TOUCHING") if any(state.touched.values()) else ("", "no")


def _pose(pose: Pose2 | None) -> str:
    if pose is None:
        return f"{'-':>7}{'-':>7}{'-':>7}"
    return f"{pose.x:7.2f}{pose.y:7.2f}{math.degrees(wrap_angle(pose.yaw)):6.0f}°"


def _motion(motion: tuple[float, float] | None) -> str:
    if motion is None:
        return f"{'-':>10}"
    # Adding 0 makes -0 a 0; one without a sign is quieter to look at.
    speed, turn = round(motion[0], 2) + 0.0, round(math.degrees(motion[1])) + 0
    return f"{speed:10.2f} m/s{turn:4d}°/s"


def _number(value: float, width: int, digits: int) -> str:
    return f"{'-':>{width}}" if math.isnan(value) else f"{value:{width}.{digits}f}"


def _battery(seconds: int | None) -> str:
    return f"{'-':>10}" if seconds is None else f"{seconds:10d} s"
