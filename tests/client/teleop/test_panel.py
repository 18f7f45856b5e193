import math

import numpy as np
import pytest

from radarsim.client import teleop_view
from radarsim.client.teleop import MIN_COLUMNS
from radarsim.geometry import Pose2, Pose3
from radarsim.protocol import reports


def panel(state: teleop_view.DrivenRobot, silence: float = 0.0) -> list[str]:
    lines = teleop_view.panel_lines(
        state, speed=0.4, commanded=(-0.4, -0.6), silence=silence
    )
    return ["".join(text for _, text in line) for line in lines]


def scan(*ranges: float) -> reports.RangeScan:
    return reports.RangeScan(1.0, "lms200", math.pi / 2, math.pi, np.array(ranges))


def fill(state: teleop_view.DrivenRobot) -> None:
    for time in (1234.5, 1234.6):
        state.take(reports.Status(time, battery=3599, light=False))
        state.take(
            reports.GroundTruth(time, "GndTruth", Pose3(-123.45, 1.0, 0.1, yaw=3.1))
        )
        state.take(reports.Ins(time, "InsTest", Pose3(-123.4, 1.2, 0.0, yaw=-3.1)))
        state.take(
            reports.Odometry(time, "Odometer", Pose2(0.5, 0.25, 4 * math.pi + 0.5))
        )
        state.take(reports.Touch(time, "Bumper", touched=False))
    state.take(scan(9.0, 5.0, 2.0))


def test_panel_shows_every_value(state: teleop_view.DrivenRobot) -> None:
    fill(state)
    text = "\n".join(panel(state))
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


def test_names_from_the_server_are_printable(state: teleop_view.DrivenRobot) -> None:
    state.level = "a\x1b[2J"
    assert panel(state)[0] == r"a\x1b[2J"


def test_unknown_values_are_dashes(state: teleop_view.DrivenRobot) -> None:
    text = "\n".join(panel(state))
    for name in ("time", "scans", "battery", "measured", "INS", "truth", "touch"):
        assert any(
            line.startswith(name) and "-" in line for line in text.splitlines()
        ), name
    assert "nothing seen" in text
    assert "no scan yet" in text


def test_panel_fits_on_24_rows(state: teleop_view.DrivenRobot) -> None:
    fill(state)
    lines = panel(state, silence=2.4)
    assert max(map(len, lines)) <= teleop_view.WIDTH
    assert len(lines) <= 23
    assert len(teleop_view.HELP) <= MIN_COLUMNS


def test_touch_is_highlighted(state: teleop_view.DrivenRobot) -> None:
    state.take(reports.Touch(1.0, "Front", touched=False))
    state.take(reports.Touch(1.0, "Back", touched=True))
    assert "touch    TOUCHING" in panel(state)


@pytest.mark.parametrize(
    ("angle", "text"),
    [
        (0.0, "ahead"),
        (math.pi / 2, "90° left"),
        (-math.pi / 2, "90° right"),
        (-math.pi, "behind"),
        (3 * math.pi / 2, "90° right"),
    ],
)
def test_bearings_are_given_in_words(angle: float, text: str) -> None:
    assert teleop_view.bearing(angle) == text


@pytest.mark.parametrize(
    ("ranges", "style", "text"),
    [
        ((9.0, 0.4, 9.0), "class:near", "0.60 m, ahead"),
        ((9.0, 5.0, 9.0), "class:far", "5.20 m, ahead"),
        ((10.0, 10.0, 10.0), "", "nothing seen"),
    ],
)
def test_nearest_obstacle_is_measured_from_the_centre_and_coloured(
    state: teleop_view.DrivenRobot, ranges: tuple[float, ...], style: str, text: str
) -> None:
    state.take(scan(*ranges))
    assert teleop_view.nearest(state) == (style, text)


def test_panel_warns(state: teleop_view.DrivenRobot) -> None:
    assert teleop_view.warnings(state, 0.1) == ["no scan yet"]
    state.take(scan(0.0, 0.0, 0.0))
    state.take(reports.Status(1.0, battery=0, light=False))
    assert teleop_view.warnings(state, 1.26) == [
        "server silent for 1.3 s",
        "scanner blinded: reads 0",
        "battery empty",
    ]
    state.take(scan(1.0, 1.0, 1.0))
    state.take(reports.Status(1.0, battery=5, light=False))
    assert teleop_view.warnings(state, 0.1) == []


@pytest.mark.parametrize("width", [7, 20, 40, 60, 64, 200])
def test_the_key_that_quits_is_shown_however_narrow_the_terminal_is(width: int) -> None:
    assert teleop_view.help_text(width).endswith("q quits")
    assert len(teleop_view.help_text(width)) <= width
