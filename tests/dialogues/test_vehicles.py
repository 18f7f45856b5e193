"""Dialogues with vehicles other than Pioneers, in the bytes of their clients."""

import re
from math import cos, hypot, pi, sin, tan
from pathlib import Path

import pytest
from wire import Wire

from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot, read_robot
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.scene.scene import Scene


@pytest.mark.parametrize(
    ("dialect", "geo", "conf", "status"),
    [
        (
            COMPAT,
            "GEO {Type GroundVehicle} {Name FrontAckerman} "
            "{Dimensions 1.4000,0.7000,1.0000} {COG 0.0000,0.0000,0.0000} "
            "{WheelRadius 0.1280} {WheelSeparation 0.4520} {WheelBase 0.9560}",
            "CONF {Type GroundVehicle} {Name FrontAckerman} "
            "{SteeringType AckermanSteered} {Mass 147.0000} {MaxSpeed 3.5186} "
            "{MaxTorque 50000.0000} {MaxFrontSteer 0.5000} {MaxRearSteer 0.0000}",
            "{FrontSteer 0.1000} {RearSteer 0.0000} {LightToggle True} ",
        ),
        (
            UDK,
            "GEO {Type GroundVehicle} {Name FrontAckerman} "
            "{Dimensions 0.9560,0.4520,0.0000} {COG 0.0000,0.0000,0.0000} "
            "{WheelRadius 0.1280} {WheelSeparation 0.4520} {WheelBase 0.9560}",
            "CONF {Name FrontAckerman} {Type GroundVehicle} "
            "{SteeringType AckermanSteered} {Mass 147.0000} {MaxSpeed 0.5600} "
            "{MaxTorque 50000.0000} {MaxFrontSteer 1.0000} {MaxRearSteer 6.2800}",
            "{LightToggle True} {LightIntensity 100} {FrontSteer 0.1000} "
            "{RearSteer 0.0000}",
        ),
    ],
)
def test_a_car_of_the_original_answers_and_drives_a_circle(
    empty_room: Scene, dialect: Dialect, geo: str, conf: str, status: str
) -> None:
    wire = Wire(empty_room, dialect)
    init = "INIT {ClassName USARBot.FrontAckerman} {Location 0,0,0} {Rotation 0,0,0}"
    assert wire.send(init, "GETGEO {Type Robot}", "GETCONF {Type Robot}") == [geo, conf]
    unit = dialect.drive_unit == "rev_per_s" or 2 * pi
    drive = f"DRIVE {{Speed {0.5 * unit:.6f}}} {{FrontSteer 0.10}} {{RearSteer 0.00}}"
    wire.send(f"{drive} {{Light true}}")
    lines = wire.wait(3)
    assert wire.news == []
    assert any(line.startswith("STA") and status in line for line in lines)
    # To the right, which is clockwise here: about a point next to the rear axle.
    radius, rear, pose = 0.956 / tan(0.1), -0.416, wire.pose
    turn = -3.01 * 0.5 * 2 * pi * 0.128 / radius
    assert pose.yaw == pytest.approx(turn, rel=0.01)
    x, y = pose.x + rear * cos(pose.yaw), pose.y + rear * sin(pose.yaw)
    assert hypot(x - rear, y + radius) == pytest.approx(radius)


def test_car_of_the_toolbox_keeps_the_angle_that_it_omits(empty_room: Scene) -> None:
    wire = Wire(empty_room)
    wire.send("INIT {ClassName USARBot.Hummer} {Location 0,0,0}")
    wire.send("DRIVE {Speed 20} {FrontSteer 0.2} {Normalized True} {Flip False}")
    wire.send("DRIVE {Speed 10}")
    lines = wire.wait(1)
    states = [line for line in lines if line.startswith("STA")]
    assert "{FrontSteer 0.2000} {RearSteer 0.0000}" in states[-1]
    top = 2.35 * 2 * pi * 0.47
    assert hypot(wire.pose.x, wire.pose.y) == pytest.approx(0.1 * top, abs=0.03)
    assert wire.pose.yaw < 0
    wire.send("DRIVE {Left 0} {Right 0}", "DRIVE {FrontSteer 1}")
    assert (
        wire.news
        == ["DRIVE of Hummer without Speed, expected Speed, FrontSteer and RearSteer"]
        * 2
    )
    wire.send("DRIVE {Speed 0}")
    where = wire.pose
    wire.wait(0.5)
    assert wire.pose == where


@pytest.mark.parametrize(
    "name", ["pioneer3at_with_sensors_r", "PIONEER3AT_WITH_SENSORS"]
)
def test_names_of_usargazebo_spawn_a_p3at(empty_room: Scene, name: str) -> None:
    wire = Wire(empty_room)
    (geo,) = wire.send(
        f"INIT {{ClassName {name}}} {{Name Robo_A}}", "GETGEO {Type Robot}"
    )
    assert wire.news == []
    assert geo == Wire(empty_room).send(
        "INIT {ClassName USARBot.P3AT}", "GETGEO {Type Robot}"
    )[0].replace("P3AT", name.lower())


@pytest.mark.parametrize("spelling", ["kenaf", "Telemax", "KURT2D", "talon", "ATRVjr"])
def test_classes_are_spelt_as_clients_spell_them(
    empty_room: Scene, spelling: str
) -> None:
    wire = Wire(empty_room)
    (conf,) = wire.send(
        f"INIT {{ClassName USARBot.{spelling}}}", "GETCONF {Type Robot}"
    )
    wire.send("DRIVE {Left 50} {Right 50} {Normalized true}")
    wire.wait(1)
    model = load_robot(spelling)
    fastest = float(re.findall(r"{MaxSpeed ([0-9.]+)}", conf)[0])
    assert wire.pose.x == pytest.approx(0.5 * fastest * model.wheel_radius, rel=0.02)
    assert wire.news == []


def last_angles(lines: list[str], package: str) -> list[float]:
    """Return the angles of links that were reported last."""
    lines = [x for x in lines if f"{{Name {package}}}" in x and "STA {Time" in x]
    return [float(text) for text in re.findall(r"{Value ([-0-9.]+)}", lines[-1])]


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
def test_flippers_turn_at_their_speed_and_do_not_drive(
    empty_room: Scene, dialect: Dialect
) -> None:
    wire = Wire(empty_room, dialect)
    wire.send("INIT {ClassName USARBot.Kenaf} {Location 0,0,0}")
    # UsarCommander, the MATLAB toolbox, a client from Rome, and the original's own.
    wire.send(
        "MULTIDRIVE {FRFlipper -0.5} {FLFlipper -0.5} {RRFlipper 3} {RLFlipper 0}"
    )
    wire.send("SET {Type Joint} {Name RLFlipper} {Opcode Angle} {Params 0.25}")
    lines = wire.wait(0.98)
    moved = last_angles(lines, "Flippers")
    assert moved == pytest.approx([-0.5, -0.5, 1.571 * 0.99, 0.25], abs=0.02)
    wire.send("DRIVE {Name FLFlipper}{Order 1}{Value -0.2}")
    wire.send("DRIVE {Name FRFlipper} {Value 0.5}", "MISPKG {Name Flippers} {Link 9}")
    moved = last_angles(wire.wait(1.98), "Flippers")
    assert moved == pytest.approx([0.5, -0.9, 2.086, 0.25], abs=0.01)
    head = "ASTA" if dialect is UDK else "MISSTA"
    assert any(line.startswith(f"{head} {{Time ") for line in wire.wait(0.1))
    assert wire.pose == Pose2(0, 0)
    known = "['Flippers 1 to 4', 'CameraPanTilt 1 to 2', 'FRFlipper', 'FLFlipper', "
    assert wire.news == [
        "MISPKG of ['Flippers 9'], which Kenaf does not have, expected one of "
        f"{known}'RRFlipper', 'RLFlipper']"
    ]


def test_camera_turns_as_usarcommander_and_the_toolbox_ask(empty_room: Scene) -> None:
    wire = Wire(empty_room)
    conf, geo = wire.send(
        "INIT {ClassName USARBot.Talon}",
        "GETCONF {Type MisPkg} {Name CameraPanTilt}",
        "GETGEO {Type MisPkg}",
    )
    assert conf == (
        "CONF {Type MisPkg} {Name CameraPanTilt} {Link 1} {JointType Revolute} "
        "{MaxSpeed 0.1700} {MaxTorque 20.0000} {MinRange 1.0000} {MaxRange 0.0000} "
        "{Link 2} {JointType Revolute} {MaxSpeed 0.1700} {MaxTorque 20.0000} "
        "{MinRange -0.1600} {MaxRange 0.4000}"
    )
    assert "{Link 1} {ParentLink -1} {Location 0.1239,0.0000,-0.2036} " in geo
    assert "{Link 2} {ParentLink 1} {Location 0.0000,0.0000,0.0599} " in geo
    wire.send("MISPKG {Name CameraPanTilt} {Link 1} {Value 9} {Link 2} {Value 1}")
    assert last_angles(wire.wait(3), "CameraPanTilt") == pytest.approx(
        [3 * 0.17, 0.4], abs=0.02
    )
    wire.send(
        "ACT {Name CameraPanTilt} {Link 1} {Value -0.1} {Order 10} {Link 2} {Value -1}"
        " {Order 2}"
    )
    turned = last_angles(wire.wait(2), "CameraPanTilt")
    assert turned == pytest.approx([3 * 0.17 - 0.1, 0.4], abs=0.02)
    assert wire.news == []


def test_actuators_of_the_original_are_mission_packages(empty_room: Scene) -> None:
    wire = Wire(empty_room, UDK)
    init = "INIT {ClassName USARBot.Kenaf}"
    (conf, geo) = wire.send(init, "GETCONF {Type Actuator}", "GETGEO {Type Actuator}")
    assert conf.startswith(
        "CONF {Type Actuator} {Name Flippers} {Link 1} {JointType Revolute} "
        "{MaxTorque 4.0000} {MinValue -2.0860} {MaxValue 2.0860} {Link 2}"
    )
    assert "{Name CameraPanTilt} {Location 0.12,0.00,-0.20}" in geo


def test_a_new_vehicle_is_one_file(empty_room: Scene, tmp_path: Path) -> None:
    file = tmp_path / "truck.yaml"
    file.write_text("""\
based_on: Sedan
name: Truck
length: 6
wheel_base: 3.5
steering: {max_front_deg: 30, max_rear_deg: 15}
items: [{type: RangeScanner, name: Roof, position: [0, 0, 1.2], sensor: sick}]
""")
    wire = Wire(empty_room, COMPAT, read_robot(file))
    replies = wire.send(
        "INIT {ClassName USARBot.Truck} {Location 0,0,0}",
        "GETCONF {Type Robot}",
        "GETGEO {Type RangeScanner} {Name Roof}",
        "DRIVE {Speed 2} {FrontSteer -0.2} {RearSteer -0.2}",
    )
    assert "{MaxFrontSteer 0.5236} {MaxRearSteer 0.2618}" in replies[0]
    assert replies[1].startswith("GEO {Type RangeScanner} {Name Roof Location 0.0000")
    lines = wire.wait(2)
    assert wire.pose.y == pytest.approx(wire.pose.x * tan(0.2))
    assert any("{Name Roof}" in line for line in lines)
