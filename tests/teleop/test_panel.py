import math

import numpy as np
import pytest

from radarsim.geometry import Pose2, Pose3
from radarsim.protocol.reports import (
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Status,
    Touch,
)
from radarsim.teleop.panel import HELP, WIDTH, bearing, nearest, panel_lines, warnings
from radarsim.teleop.robot_state import RobotState
from radarsim.teleop.terminal import LEAST_COLUMNS


def panel(readings: RobotState, silence: float = 0.0) -> list[str]:
    lines = panel_lines(readings, speed=0.4, ordered=(-0.4, -0.6), silence=silence)
    return ["".join(text for _, text in line) for line in lines]


def scan(*ranges: float) -> RangeScan:
    return RangeScan(1.0, "lms200", math.pi / 2, math.pi, np.array(ranges))


def fill(readings: RobotState) -> None:
    for time in (1234.5, 1234.6):
        readings.take(Status(time, battery=3599, light=False))
        readings.take(GroundTruth(time, "GndTruth", Pose3(-123.45, 1.0, 0.1, yaw=3.1)))
        readings.take(Ins(time, "InsTest", Pose3(-123.4, 1.2, 0.0, yaw=-3.1)))
        readings.take(Odometry(time, "Odometer", Pose2(0.5, 0.25, 4 * math.pi + 0.5)))
        readings.take(Touch(time, "Bumper", touched=False))
    readings.take(scan(9.0, 5.0, 2.0))


def test_everything_is_there(readings: RobotState) -> None:
    fill(readings)
    text = "\n".join(panel(readings))
    for expected in (
        "DM-Test",
        "P3AT, lms200",
        "battery        3599 s",
        "speed          0.40 m/s",
        "ordered       -0.40 m/s -34°/s",
        "measured       0.00 m/s   0°/s",
        "INS      -123.40   1.20  -178°",
        "odometry    0.50   0.25    29°",
        "truth    -123.45   1.00   178°",
        "touch    no",
        "nearest  2.01 m, 84° left",
    ):
        assert expected in text


def test_what_nobody_has_told_is_a_dash(readings: RobotState) -> None:
    text = "\n".join(panel(readings))
    for name in ("time", "scans", "battery", "measured", "INS", "truth", "touch"):
        assert any(
            line.startswith(name) and "-" in line for line in text.splitlines()
        ), name
    assert "nothing seen" in text
    assert "no scan yet" in text


def test_it_fits_beside_the_view_on_24_rows(readings: RobotState) -> None:
    fill(readings)
    lines = panel(readings, silence=2.4)
    assert max(map(len, lines)) <= WIDTH
    assert len(lines) <= 23
    assert len(HELP) <= LEAST_COLUMNS


def test_a_touch_is_loud(readings: RobotState) -> None:
    readings.take(Touch(1.0, "Front", touched=False))
    readings.take(Touch(1.0, "Back", touched=True))
    assert "touch    TOUCHING" in panel(readings)


@pytest.mark.parametrize(
    ("angle", "text"),
    [
        pytest.param(0.0, "ahead", id="ahead"),
        pytest.param(math.pi / 2, "90° left", id="left"),
        pytest.param(-math.pi / 2, "90° right", id="right"),
        pytest.param(-math.pi, "behind", id="behind"),
        pytest.param(3 * math.pi / 2, "90° right", id="wrapped"),
    ],
)
def test_bearings_are_words(angle: float, text: str) -> None:
    assert bearing(angle) == text


@pytest.mark.parametrize(
    ("ranges", "style", "text"),
    [
        pytest.param((9.0, 0.4, 9.0), "class:near", "0.60 m, ahead", id="near"),
        pytest.param((9.0, 5.0, 9.0), "class:far", "5.20 m, ahead", id="far"),
        pytest.param((10.0, 10.0, 10.0), "", "nothing seen", id="nothing"),
    ],
)
def test_the_nearest_is_told_from_the_centre_in_its_colour(
    readings: RobotState, ranges: tuple[float, ...], style: str, text: str
) -> None:
    readings.take(scan(*ranges))
    assert nearest(readings) == (style, text)


def test_warnings(readings: RobotState) -> None:
    assert warnings(readings, 0.1) == ["no scan yet"]
    readings.take(scan(0.0, 0.0, 0.0))
    readings.take(Status(1.0, battery=0, light=False))
    assert warnings(readings, 1.26) == [
        "server silent for 1.3 s",
        "scanner blinded: reads 0",
        "battery empty",
    ]
    readings.take(scan(1.0, 1.0, 1.0))
    readings.take(Status(1.0, battery=5, light=False))
    assert warnings(readings, 0.1) == []
