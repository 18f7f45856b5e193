"""Replies to GETGEO and GETCONF, byte for byte, for all items of robots."""

import re

import pytest

from radarsim.presets.robots import load_robot, robot_names
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig


def ask(
    scene: Scene,
    asked: str,
    *,
    class_name: str = "P3AT",
    config: SimulationConfig | None = None,
    yaw: float = 0.0,
) -> list[str]:
    """Return the replies in the first ticks of a robot, without other output."""
    host = Host(scene, config=config)
    number = host.connect()
    init = f"INIT {{ClassName {class_name}}} {{Location -8,0,0}} {{Rotation 0,0,{yaw}}}"
    host.take(number)
    host.receive(number, f"{init}\r\n{asked}\r\n".encode())
    host.step()
    while host.is_busy(number):
        host.step()
    return host.take(number).decode("ascii").split("\r\n")[:-1]


COMPAT_REPLIES = {
    "GETCONF {Type Robot}": (
        "CONF {Type GroundVehicle} {Name P3AT} {SteeringType SkidSteered} "
        "{Mass 11.9000} {MaxSpeed 8.1700} {MaxTorque 50000.0000} "
        "{MaxFrontSteer 0.0000} {MaxRearSteer 0.0000}"
    ),
    "GETGEO {Type rangeSCANNER}": (  # its type is echoed
        "GEO {Type rangeSCANNER} {Name lms200 Location 0.2085,0.0000,-0.2000 "
        "Orientation 0.0000,0.0000,0.0000 Mount HARD}"
    ),
    "GETCONF {Type RangeScanner} {Name LMS200}": (
        "CONF {Type RangeScanner} {Name lms200} {MaxRange 80.0000} "
        "{MinRange 0.1000} {Resolution 0.017453} {Fov 3.141593}"
    ),
    "GETCONF {Type INS} {Name }": (
        "CONF {Type INS} {Name InsTest} {ScanInterval 0.1000}"
    ),
    "GETCONF {Type Encoder}": (
        "CONF {Type Encoder} {Name W1} {Resolution 0.017450} "
        "{Name W2} {Resolution 0.017450}"
    ),
    "GETCONF {Type MisPkg}": "CONF {Type MisPkg}",
}
UDK_REPLIES = {
    "GETCONF {Type Robot}": (
        "CONF {Name P3AT} {Type GroundVehicle} {SteeringType SkidSteered} "
        "{Mass 11.9000} {MaxSpeed 1.2999} {MaxTorque 50000.0000} "
        "{MaxFrontSteer 0} {MaxRearSteer 0}"
    ),
    "GETGEO {Type Robot}": (
        "GEO {Type GroundVehicle} {Name P3AT} {Dimensions 0.2480,0.3600,0.0000} "
        "{COG 0.0000,0.0000,0.0000} {WheelRadius 0.0980} {WheelSeparation 0.3600} "
        "{WheelBase 0.2480}"
    ),
    "GETGEO {Type rangescanner} {Name LMS200}": (
        "GEO {Type rangescanner} {Name lms200} {Location 0.21,0.00,-0.20} "
        "{Orientation 0.00,0.00,0.00}{Mount P3AT}"
    ),
    "GETCONF {Type RangeScanner}": (
        "CONF {Type RangeScanner} {Name lms200} {MaxRange 20.0000} "
        "{MinRange 0.1000} {Resolution 0.0174} {Fov 3.1414} "
        "{Panning True} {Tilting False}"
    ),
}
P2AT_REPLIES = {
    "GETGEO {Type Sonar} {Name f2}": (
        "GEO {Type Sonar} {Name F2 Location 0.1850,-0.1150,0.0000 "
        "Orientation 0.0000,0.0000,-0.8727 Mount HARD}"
    ),
    "GETGEO {Type GPS} {Name }": (
        "GEO {Type GPS} {Name GPS Location -0.1000,0.0000,-0.2000 "
        "Orientation 0.0000,0.0000,0.0000 Mount HARD}"
    ),
}
P2AT_UDK_REPLIES = {
    "GETCONF {Type Sonar} {Name F1}": (
        "CONF {Type Sonar} {Name F1} {MaxRange 5.0000} {MinRange 0.1000} "
        "{ScanInterval 0.2000} {beamAngle 0.3489} {maxAngleOfIncidence 0.1745} "
        "{tracesPerCone 16} {numberOfCones 10}"
    )
}


@pytest.mark.parametrize(
    ("class_name", "dialect", "replies"),
    [
        ("P3AT", COMPAT, COMPAT_REPLIES),
        ("P3AT", UDK, UDK_REPLIES),
        ("P2AT", COMPAT, P2AT_REPLIES),
        ("P2AT", UDK, P2AT_UDK_REPLIES),
    ],
)
def test_replies_of_a_robot_in_a_dialect(
    empty_room: Scene, class_name: str, dialect: Dialect, replies: dict[str, str]
) -> None:
    asked, config = "\r\n".join(replies), SimulationConfig(dialect)
    found = ask(empty_room, asked, class_name=class_name, config=config, yaw=1.5)
    assert found == [*replies.values()]


@pytest.mark.parametrize(("class_name", "sides"), [("P2AT", "FR"), ("P2DX", "F")])
@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
@pytest.mark.parametrize("verb", ["GEO", "CONF"])
def test_all_sonars_are_in_one_line_that_fits_into_one_read(
    empty_room: Scene, class_name: str, sides: str, dialect: Dialect, verb: str
) -> None:
    config = SimulationConfig(dialect)
    asked = f"GET{verb} {{Type Sonar}} {{Name }}"
    (reply,) = ask(empty_room, asked, class_name=class_name, config=config)
    names = re.findall(r"{Name ([FR]\d)", reply)
    assert names == [f"{side}{i}" for side in sides for i in range(1, 9)]
    assert len(reply) + 2 <= 4095


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
@pytest.mark.parametrize("class_name", robot_names())
def test_every_item_of_every_robot_gets_a_reply(
    empty_room: Scene, class_name: str, dialect: Dialect
) -> None:
    items = load_robot(class_name).in_dialect(dialect.name).items
    asked = [
        f"{verb} {{Type {item.type}}} {{Name {item.name}}}"
        for item in items
        for verb in ("GETGEO", "GETCONF")
    ]
    replies = ask(
        empty_room,
        "\r\n".join(asked),
        class_name=class_name,
        config=SimulationConfig(dialect),
    )
    assert len(replies) == 2 * len(items)
    for question, answer in zip(asked, replies, strict=True):
        verb, kind, name = re.findall(r"GET(\w+) {Type (\w+)} {Name (\w+)}", question)[
            0
        ]
        assert answer.startswith(f"{verb} {{Type {kind}}} {{Name {name}")


def test_unknown_items_get_no_reply(empty_room: Scene) -> None:
    asked = (
        "GETGEO {Type MisPkg}",  # packages have no place
        "GETCONF {Type RFID}",
        "GETCONF {Type Sonar} {Name }",
        "GETCONF {Name lms200}",
    )
    assert ask(empty_room, "\r\n".join(asked)) == []


def test_two_scanners_are_in_one_reply(empty_room: Scene) -> None:
    (geo,) = ask(empty_room, "GETGEO {Type RangeScanner}", class_name="P3AT_Compare")
    assert re.findall(r"{Name (\w+) Location", geo) == ["lms200", "Hokuyo"]


def test_reply_has_the_changed_settings(empty_room: Scene) -> None:
    changed = SimulationConfig(
        item_settings={"LMS200": {"fov_deg": 90, "max_range": 12, "min_range": 1}}
    )
    assert ask(empty_room, "GETCONF {Type RangeScanner}", config=changed) == [
        "CONF {Type RangeScanner} {Name lms200} {MaxRange 12.0000} {MinRange 1.0000} "
        "{Resolution 0.017453} {Fov 1.570796}"
    ]


def test_top_speed_is_in_the_drive_unit(empty_room: Scene) -> None:
    turns = SimulationConfig(drive_unit="rev_per_s")
    (conf,) = ask(empty_room, "GETCONF {Type Robot}", config=turns)
    assert "{MaxSpeed 1.3000}" in conf
