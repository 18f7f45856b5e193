"""A hall for a thousand robots, and the lines of clients that drive in it."""

import math
from pathlib import Path
from typing import Final

SIDE: Final = 90.0  # m
WALL: Final = 0.2  # m
POLES: Final = 11  # in a row, and rows
# Robots stand on a grid, and poles between them.
ROBOTS_IN_A_ROW: Final = 36
GAP: Final = 2.4  # m between robots
STRIDE: Final = 803  # has no divisor in common with the number of places
TURN: Final = 2.4  # rad from each robot to the next
FAST, SLOW = 4.0, 2.5  # rad/s of the wheels outside and inside of a circle


def hall_map(poles: int) -> str:
    """Return a map file of a hall with so many poles in each of as many rows."""
    ends = (SIDE + WALL) / 2
    objects = [
        _box("floor", (SIDE, SIDE, WALL), (0.0, 0.0, -WALL / 2)),
        _box("north", (SIDE, WALL, 3.0), (0.0, ends, 1.5)),
        _box("south", (SIDE, WALL, 3.0), (0.0, -ends, 1.5)),
        _box("east", (WALL, SIDE, 3.0), (ends, 0.0, 1.5)),
        _box("west", (WALL, SIDE, 3.0), (-ends, 0.0, 1.5)),
    ]
    for i in range(poles * poles):
        x, y = (3 * GAP * (k - (poles - 1) / 2) for k in divmod(i, poles))
        objects.append(
            f"{{name: pole_{i}, cylinder: [0.3, 2.5], position: [{x:g}, {y:g}, 1.25],"
            " material: concrete}"
        )
    lines = ["version: 1", "materials: {concrete: {density: opaque}}", "objects:"]
    lines += [f"  - {text}" for text in objects]
    lines += ["starts:", "  - {name: RobotStart1, position: [1.2, 1.2, 0], yaw_deg: 0}"]
    return "\n".join(lines) + "\n"


def write_hall(folder: Path, poles: int = POLES) -> Path:
    """Write the map file of a hall into a folder, and return its path."""
    path = folder / f"hall_{poles}.yaml"
    path.write_text(hall_map(poles), encoding="utf-8")
    return path


def init_line(number: int) -> bytes:
    """Return the line that spawns a robot at the place of its number, from 0.

    Few robots are spread over the whole hall, as many are.
    """
    places = ROBOTS_IN_A_ROW * ROBOTS_IN_A_ROW
    row, column = divmod(number * STRIDE % places, ROBOTS_IN_A_ROW)
    x, y = (GAP * (k - (ROBOTS_IN_A_ROW - 1) / 2) for k in (column, row))
    yaw = math.remainder(TURN * number, math.tau)
    place = f"{{Location {x:.2f},{y:.2f},0}} {{Rotation 0,0,{yaw:.4f}}}"
    return f"INIT {{ClassName P3AT}} {{Name R{number}}} {place}\r\n".encode()


def drive_line(number: int) -> bytes:
    """Return the line that lets a robot drive in circles, half of them to the left."""
    left, right = (SLOW, FAST) if number % 2 else (FAST, SLOW)
    return f"DRIVE {{Left {left}}} {{Right {right}}}\r\n".encode()


def _box(
    name: str, size: tuple[float, float, float], at: tuple[float, float, float]
) -> str:
    return (
        f"{{name: {name}, box: [{size[0]:g}, {size[1]:g}, {size[2]:g}],"
        f" position: [{at[0]:g}, {at[1]:g}, {at[2]:g}], material: concrete}}"
    )
