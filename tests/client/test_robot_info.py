from dataclasses import replace
from math import cos, inf, nan, pi, radians, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.client import robot_info
from radarsim.errors import ClientError
from radarsim.geometry import Pose3
from radarsim.protocol import reports
from radarsim.protocol.dialect import COMPAT
from radarsim.protocol.line_template import NumberFormat, Rounding

GEO = reports.RobotGeo("P3AT", (0.6, 0.8, 0.4), (0, 0, 0), 0.1, 0.4, 0.3)
CONF = reports.RobotConf("P3AT", 10, 8, 50)
MOUNT = Pose3(0.2, 0, 0.1)
SCANNER = robot_info.ScannerInfo("S", MOUNT, 0.1, 80, radians(1), radians(180), 181)
ROBOT = robot_info.RobotInfo("P3AT", 0.6, 0.8, 0.4, 0.1, 0.4, 0.8, 1.0, (SCANNER,))


def test_robot_info_from_complete_reports() -> None:
    info = robot_info.RobotInfo.from_reports(GEO, CONF, (SCANNER,), "rad_per_s")
    assert info.max_wheel_speed == pytest.approx(0.8)
    assert replace(info, max_wheel_speed=0.8) == ROBOT
    assert ROBOT.clearance == pytest.approx(0.5)
    assert ROBOT.top_speed == 0.8


def test_drive_unit_does_not_change_the_robot() -> None:
    turns = robot_info.RobotInfo.from_reports(
        GEO, replace(CONF, max_speed=8 / (2 * pi)), (), "rev_per_s"
    )
    assert turns.max_wheel_speed == pytest.approx(0.8)
    expected = np.array(ROBOT.wheel_speeds(0.5, 0.3)) / (2 * pi)
    assert turns.wheel_speeds(0.5, 0.3) == pytest.approx(expected)


@given(speed=st.floats(-3, 3), turn=st.floats(-9, 9))
def test_limited_wheel_speeds_follow_the_same_curve_slower(
    speed: float, turn: float
) -> None:
    left, right = (spin * 0.1 for spin in ROBOT.wheel_speeds(speed, turn))
    assert max(abs(left), abs(right)) <= 0.8 + 1e-9
    got_speed, got_turn = (left + right) / 2, (right - left) / 0.4
    fastest = abs(speed) + abs(turn) * 0.2
    share = min(1.0, 0.8 / fastest) if fastest else 1.0
    assert (got_speed, got_turn) == pytest.approx((share * speed, share * turn))


@pytest.mark.parametrize("turn", [1.7e308, -1.7e308, 1.0])
def test_wheel_speeds_of_the_largest_numbers_are_numbers(turn: float) -> None:
    speeds = [spin * 0.1 for spin in ROBOT.wheel_speeds(1.7e308, turn)]
    assert max(map(abs, speeds)) == pytest.approx(0.8)


@pytest.mark.parametrize(
    "geo",
    [
        replace(GEO, dimensions=(0.3, 0.4, 0)),
        replace(GEO, dimensions=(0, 0, 0)),
        replace(GEO, dimensions=(0.3, 0.4, 0), wheel_base=nan),
    ],
    ids=["wheels", "nothing", "base"],
)
def test_unreported_hull_reaches_beyond_the_wheels(geo: reports.RobotGeo) -> None:
    info = robot_info.RobotInfo.from_reports(geo, CONF, (), "rad_per_s")
    assert (info.length, info.width) == pytest.approx((0.7, 0.6))
    assert info.height == 0


@pytest.mark.parametrize(
    ("geo", "conf", "key"),
    [
        (replace(GEO, wheel_radius=0), CONF, "WheelRadius"),
        (replace(GEO, wheel_separation=-1), CONF, "WheelSeparation"),
        (GEO, replace(CONF, max_speed=0), "MaxSpeed"),
        (replace(GEO, wheel_radius=1e-9), CONF, "WheelRadius"),
        (GEO, replace(CONF, max_speed=1e9), "MaxSpeed"),
    ],
)
def test_implausible_wheels_are_refused(
    geo: reports.RobotGeo, conf: reports.RobotConf, key: str
) -> None:
    with pytest.raises(ClientError, match=rf"{key} .* 'P3AT', expected 0.001 to"):
        robot_info.RobotInfo.from_reports(geo, conf, (), "rad_per_s")


def test_negative_dimensions_are_refused() -> None:
    geo = replace(GEO, dimensions=(0.6, -1, 0.4))
    with pytest.raises(ClientError, match=r"Dimensions .*, expected none below 0"):
        robot_info.RobotInfo.from_reports(geo, CONF, (), "rad_per_s")


@pytest.mark.parametrize(
    ("limits", "text"),
    [
        ((0, 0, 0.01, 3), "MaxRange 0"),
        ((-80, 0, 0.01, 3), "MaxRange -80"),
        ((80, 0, 1e-9, 3), "at most 100000 beams"),
        ((80, 0, 0.01, -3), "FOV -3"),
        ((80, 0, 1, 180), "FOV 180"),
        ((80, 0, 1e6, 1e6), "FOV 1e"),
    ],
)
def test_implausible_scanner_is_refused(
    limits: tuple[float, float, float, float], text: str
) -> None:
    descriptions = robot_info.ScannerDescriptions()
    descriptions.add(reports.ScannerConf("RangeScanner", (("S", *limits),)))
    with pytest.raises(ClientError, match=rf"scanner 'S' has .*{text}"):
        descriptions.scanners({})


def test_a_scanner_away_from_its_robot_is_refused() -> None:
    descriptions = robot_info.ScannerDescriptions()
    descriptions.add(reports.ItemGeo("RangeScanner", (("S", Pose3(8, 8, 0)),), "P3AT"))
    with pytest.raises(
        ClientError, match=r"mount 11\.3\d* m .*, expected at most 10 m"
    ):
        descriptions.scanners({})


def test_names_in_any_case_are_one_scanner() -> None:
    descriptions = robot_info.ScannerDescriptions()
    descriptions.add(reports.ItemGeo("RangeScanner", (("lms200", MOUNT),), "P3AT"))
    descriptions.add(
        reports.ScannerConf("RangeScanner", (("Lms200", 20, 0.1, 0.5, 1),))
    )
    scans = {"LMS200": reports.RangeScan(1, "LMS200", 0.5, 1.0, np.ones(3))}
    assert descriptions.names(scans) == ["lms200"]
    assert descriptions.incomplete(scans) == []
    (info,) = descriptions.scanners(scans)
    assert info == robot_info.ScannerInfo("LMS200", MOUNT, 0.1, 20, 0.5, 1.0, 3)


def test_a_scanner_is_found_by_its_name_in_any_case() -> None:
    other = replace(SCANNER, name="T")
    robot = replace(ROBOT, scanners=(SCANNER, other))
    assert robot.scanner() is SCANNER
    assert robot.scanner("t") is other
    with pytest.raises(ClientError, match=r": \['S', 'T'\], expected the scanner 'U'"):
        robot.scanner("U")
    with pytest.raises(ClientError, match=r"of 'P3AT': \[\], expected a scanner"):
        replace(ROBOT, scanners=()).scanner()


@pytest.mark.parametrize(
    ("step_deg", "fov_deg"),
    [(1, 180), (1, 359), (0.5, 180), (0.25, 270), (0.36, 240), (0.1, 180), (2, 0)],
)
def test_beam_count_is_right_despite_rounding_on_the_wire(
    step_deg: float, fov_deg: float
) -> None:
    step, fov = radians(step_deg), radians(fov_deg)
    descriptions = robot_info.ScannerDescriptions()
    descriptions.add(
        _printed(reports.ScannerConf("RangeScanner", (("S", 80, 0, step, fov),)))
    )
    (info,) = descriptions.scanners({})
    assert info.beams == len(info.angles) == int(fov_deg / step_deg + 1e-9) + 1
    assert info.angles[-1] == pytest.approx(fov / 2, abs=1e-5)
    assert (info.mount, info.max_range) == (Pose3(0, 0, 0), 80)


def test_beam_count_is_taken_from_a_scan_if_there_is_one() -> None:
    scan = reports.RangeScan(1, "S", 0.0174, 3.1415, np.zeros(181))
    descriptions = robot_info.ScannerDescriptions()
    descriptions.add(
        reports.ScannerConf("RangeScanner", (("S", 20, 0.1, 0.0174, 3.1415),))
    )
    descriptions.add(reports.ItemGeo("RangeScanner", (("S", MOUNT),), "P3AT"))
    (info,) = descriptions.scanners({"S": scan})
    assert info.beams == 181
    assert info.resolution == pytest.approx(radians(1), abs=1e-6)
    assert np.array_equal(info.angles, robot_info.beam_angles(scan))
    assert np.allclose(
        np.degrees(robot_info.beam_angles(scan)), np.arange(-90, 91), atol=0.01
    )


def test_missing_scanner_properties_are_taken_from_scans_or_defaults() -> None:
    descriptions = robot_info.ScannerDescriptions()
    descriptions.add(reports.NameConf("RangeScanner", ("S",)))
    descriptions.add(reports.ItemGeo("RangeScanner", (("mute", MOUNT),), ""))
    scans = {
        "S": reports.RangeScan(1, "S", 0.5, 1.0, np.ones(3)),
        "one": reports.RangeScan(1, "one", 0.5, 0.0, np.ones(1)),
    }
    assert descriptions.names(scans) == ["mute", "S", "one"]
    assert descriptions.incomplete(scans) == ["mute", "S", "one"]
    nowhere = Pose3(0, 0, 0)
    assert descriptions.scanners(scans) == (
        robot_info.ScannerInfo("S", nowhere, 0, inf, 0.5, 1.0, 3),
        robot_info.ScannerInfo("one", nowhere, 0, inf, 0.5, 0.0, 1),
    )


def _printed(report: reports.Report) -> reports.Report:
    read = reports.decode_report(report.encode(COMPAT))
    assert read is not None
    return read


ANGLES = np.radians(np.arange(-179.5, 180.0))


@given(
    st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-pi, pi), st.integers(0, 359)
)
def test_beam_end_is_the_same_point_from_the_centre(
    x: float, y: float, yaw: float, beam: int
) -> None:
    ranges = np.full(360, 3.0)
    bearings, lengths = robot_info.from_centre(
        ranges, ANGLES, Pose3(x, y, 0.2, yaw=yaw), 80.0
    )
    angle = ANGLES[beam] + yaw
    seen = (x + 3 * cos(angle), y + 3 * sin(angle))
    result = lengths[beam] * np.array([cos(bearings[beam]), sin(bearings[beam])])
    assert result == pytest.approx(seen, abs=1e-9)
    assert np.all((bearings >= -pi) & (bearings < pi))


def test_beam_without_return_is_infinite_and_keeps_its_bearing() -> None:
    ranges = np.array([80.0, 79.0, 85.0])
    angles = np.array([-pi, 0.0, 1.0])
    bearings, lengths = robot_info.from_centre(ranges, angles, Pose3(0.2, 0, 0.2), 80.0)
    assert lengths.tolist() == [inf, pytest.approx(79.2), inf]
    assert bearings == pytest.approx([-pi, 0, 1.0], abs=1e-3)


@pytest.mark.parametrize("rounding", [Rounding.NEAREST, Rounding.TRUNCATED])
@given(max_range=st.floats(0.1, 200.0), nearer=st.floats(0.03, 100.0))
def test_no_return_differs_from_returns_however_ranges_are_rounded(
    rounding: Rounding, max_range: float, nearer: float
) -> None:
    wire = NumberFormat(2, rounding)
    limit = robot_info.no_return(round(max_range, 6))
    assert float(wire.format(max_range)) >= limit
    assert float(wire.format(max(max_range - nearer, 0.0))) < limit


def test_without_a_maximum_range_every_range_is_a_return() -> None:
    assert robot_info.no_return(inf) == inf
