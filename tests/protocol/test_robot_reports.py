"""GEO and CONF lines of USARSim servers of all generations."""

from dataclasses import astuple
from math import isnan

import pytest

from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose3
from radarsim.protocol import reports

MOUNTS = (("S1", Pose3(0.2, 0, 0.1)), ("S2", Pose3(-0.2, 0, 0.1, 0, 0, -3.1)))


@pytest.mark.parametrize(
    "line",
    [
        pytest.param(
            "GEO {Type RangeScanner}"
            " {Name S1} {Location 0.2,0,-0.1} {Orientation 0,0,0}{Mount P3AT}"
            " {Name S2} {Location -0.2,0,-0.1} {Orientation 0,0,3.1}{Mount P3AT}",
            id="a group for each word",
        ),
        pytest.param(
            "GEO {Mount P3AT} {Location 0.2,0,-0.1} {Name S1} {Type RangeScanner}"
            " {Location -0.2, 0, -0.1} {Orientation 0 0 3.1} {Name S2}",
            id="another order, and one not turned",
        ),
    ],
)
def test_mounts_are_decoded_in_every_server_format(line: str) -> None:
    assert reports.decode_report(line) == reports.ItemGeo(
        "RangeScanner", MOUNTS, "P3AT"
    )


def test_configuration_of_another_server_is_decoded() -> None:
    line = "CONF {Type RangeScanner} {Name S} {MaxRange 20} {MinRange 0.1}"
    conf = reports.decode_report(f"{line} {{Resolution 0.01}} {{Fov 3}} {{X 2}}")
    assert conf == reports.ScannerConf("RangeScanner", (("S", 20, 0.1, 0.01, 3),))


def test_optional_fields_may_be_missing() -> None:
    robot = reports.decode_report(
        "GEO {Type LeggedRobot} {Dimensions 1,2,3} {WheelRadius 1} {WheelSeparation 2}"
    )
    assert isinstance(robot, reports.RobotGeo)
    assert all(isnan(number) for number in (*robot.cog, robot.wheel_base))
    abilities = reports.decode_report(
        "CONF {Type groundvehicle} {Name P3AT} {MaxSpeed 5}"
    )
    assert isinstance(abilities, reports.RobotConf)
    assert isnan(abilities.mass)
    assert isnan(abilities.max_torque)
    scanner = reports.decode_report("CONF {Type RangeScanner} {Name S} {MaxRange 20}")
    assert isinstance(scanner, reports.ScannerConf)
    (_, longest, shortest, *fan), *others = astuple(scanner)[1]
    assert (longest, shortest, others) == (20, 0, [])
    assert all(isnan(number) for number in fan)


MISSING = {
    "no type": ("GEO {Name S}", "expected a field '{Type ...}'"),
    "no separation": (
        "GEO {Type GroundVehicle} {Dimensions 1,2,3} {WheelRadius 1}",
        "'{WheelSeparation ...}'",
    ),
    "no place": ("GEO {Type INS} {Name I}", "'{Location ...}'"),
    "one interval of two": (
        "CONF {Type INS} {Name A} {ScanInterval 1} {Name B}",
        "'{ScanInterval ...}'",
    ),
}


@pytest.mark.parametrize(("line", "message"), MISSING.values(), ids=MISSING)
def test_missing_required_field_raises_an_error(line: str, message: str) -> None:
    with pytest.raises(MalformedMessage, match=message):
        reports.decode_report(line)
