"""Dialogues with robots that fly, in the bytes of their clients."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from wire import Wire

from radarsim.geometry import Pose3
from radarsim.presets.robots import load_robot, read_robot
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene, StartPose
from radarsim.scene.shapes import box

GEO = "GEO {Type AerialVehicle} {Name AirRobot} {Dimensions 1.0000,1.0000,0.2400} "
CONFS = {
    "compat": "CONF {Type AerialVehicle} {Name AirRobot} {Mass 1.0000} "
    "{MaxSpeed 2.0000}",
    "udk": "CONF {Name AirRobot} {Type AerialVehicle} {Mass 1.0000} {MaxSpeed 2.0000}",
}
STATES = {
    "compat": "STA {Type AerialVehicle} {Time 1.10} {LightToggle False} "
    "{LightIntensity 0} {Battery 3598} {View -1}",
    "udk": "STA {Time 1.1000} {Battery 1198} {Type AerialVehicle} "
    "{LightToggle False} {LightIntensity 100}",
}

SECONDS = 20  # of a flight


def fly(up: float, ahead: float, right: float, clockwise: float) -> str:
    """Return a command as bot_ardrone and LcmProxy write it."""
    return (
        f"DRIVE {{AltitudeVelocity {up:f}}} {{LinearVelocity {ahead:f}}} "
        f"{{LateralVelocity {right:f}}} {{RotationalVelocity {clockwise:f}}} "
        "{Normalized false}"
    )


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
def test_air_robot_hovers_flies_an_arc_and_rises(
    empty_room: Scene, dialect: Dialect
) -> None:
    wire = Wire(empty_room, dialect)
    init = "INIT {ClassName USARBot.AirRobot} {Location 0,0,-1} {Rotation 0,0,0}"
    geo, conf = wire.send(init, "GETGEO {Type Robot}", "GETCONF {Type Robot}")
    assert geo.startswith(GEO)
    assert conf == CONFS[dialect.name]
    states = [line for line in wire.wait(1.1) if line.startswith("STA")]
    assert states[-1] == STATES[dialect.name]
    assert wire.body == Pose3(0, 0, 1)
    # A turn of a radian to the right in 4 s, in the unit of the servers.
    rate = 0.25 if dialect is COMPAT else math.degrees(0.25)
    wire.send(fly(0.2, 0.5, 0.25, rate))
    wire.wait(3.99)
    chord = 4 * math.sin(0.5) / 0.5
    heading = np.array([math.cos(0.5), -math.sin(0.5)])
    aside = np.array([-math.sin(0.5), -math.cos(0.5)])
    place = chord * (0.5 * heading + 0.25 * aside)
    assert wire.body.position() == pytest.approx([*place, 1.8])
    assert wire.body.yaw == pytest.approx(-1.0)
    wire.send("DRIVE {AltitudeVelocity 0} {LinearVelocity 0}")  # others go on
    yaw = wire.body.yaw
    wire.wait(1)
    assert wire.body.yaw < yaw - 0.2
    wire.send(fly(0, 0, 0, 0))
    wire.wait(1)  # in which it gets level again
    before = wire.body
    wire.wait(1)
    assert wire.body == before
    assert (before.roll, before.pitch) == (0, 0)
    assert wire.news == []


def readings_of(lines: list[str], kind: str) -> list[dict[str, str]]:
    """Return the fields of the readings of a kind of sensor."""
    found = [line for line in lines if f"{{Type {kind}}}" in line]
    return [dict(re.findall(r"{(\w+) ([^}]*)}", line)) for line in found]


def test_drone_leans_in_udk_as_the_original_and_all_on_it_with_it(
    empty_room: Scene,
) -> None:
    wire = Wire(empty_room, UDK)
    wire.send("INIT {ClassName USARBot.AirRobot} {Location 0,0,-1.2}")
    (drone,) = wire.host.simulation.vehicles
    wire.send(fly(0, 0.2, 0.1, 0))  # a tick passes
    wire.wait(0.29)
    rate, full = math.radians(38.45), math.radians(25)
    assert (wire.body.roll, wire.body.pitch) == pytest.approx((0.3 * rate, 0.3 * rate))
    lines = wire.wait(0.5)
    assert (wire.body.roll, wire.body.pitch) == pytest.approx((full, full))
    # On the wire the nose down is negative, and the right side down positive.
    truth = readings_of(lines, "GroundTruth")[-1]
    assert truth["Orientation"] == "0.436,-0.436,0.000"
    unit = [float(x) for x in readings_of(lines, "IMU")[0]["AngularVel"].split(",")]
    assert unit == pytest.approx([rate, -rate, 0], abs=2e-3)
    ins = readings_of(lines, "INS")[-1]["Orientation"].split(",")
    assert float(ins[1]) == pytest.approx(2 * math.pi - full, abs=0.1)
    camera = drone.camera_pose(drone.cameras[0])
    level = Pose3(0, 0, 0, wire.body.roll, wire.body.pitch).rotation()
    assert camera.rotation() == pytest.approx(level)
    # Straight ahead the scanner reads the floor.
    ranges = readings_of(wire.wait(0.2), "RangeScanner")[-1]["Range"].split(",")
    sensor = drone.sensor_pose(drone.scanners[0].item)
    reach = sensor.z / -sensor.rotation()[2, 0]
    assert float(ranges[90]) == pytest.approx(reach, abs=0.1)
    # With percentages it tilts by a fourth; with no speeds, as before.
    wire.send("DRIVE {LinearVelocity -50} {Normalized true}")
    wire.wait(2)
    assert wire.body.pitch == pytest.approx(-full / 4)
    assert wire.body.roll == pytest.approx(full)
    wire.send(fly(0, 0, 0, 1))
    wire.wait(1)
    assert (wire.body.roll, wire.body.pitch) == (0, 0)
    wire.send("DRIVE {LinearVelocity 1}")
    wire.wait(1)
    drone.robot.halt()
    wire.wait(1)
    assert wire.body.pitch == 0


def test_drone_stays_level_in_compat(empty_room: Scene) -> None:
    wire = Wire(empty_room)
    wire.send("INIT {ClassName USARBot.AirRobot}", fly(0, 0.2, 0.1, 0))
    wire.wait(1)
    assert (wire.body.roll, wire.body.pitch) == (0, 0)


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
def test_altitude_compass_and_minutes(empty_room: Scene, dialect: Dialect) -> None:
    wire = Wire(empty_room, dialect)
    wire.send("INIT {ClassName USARBot.AirRobot} {Location 0,0,-1} {Rotation 0,0,3}")
    rate = 0.1 if dialect is COMPAT else math.degrees(0.1)
    wire.send(fly(-0.25, 0, 0, rate))
    lines = wire.wait(1.98)
    digits = ".00" if dialect is COMPAT else ".0000"
    assert f"SEN {{Time 2{digits}}} {{Type AltitudeSensor}} {{Name Altitude}} " in (
        "".join(lines)
    )
    height = readings_of(lines, "AltitudeSensor")[-1]
    assert float(height["relativeAltitude"]) == pytest.approx(-0.4975, abs=2e-4)
    assert float(height["absoluteAltitude"]) == pytest.approx(110.5025, abs=2e-4)
    # Clockwise from the x axis, past half a turn.
    angle = float(readings_of(lines, "MagneticCompass")[-1]["MagneticAngle"])
    assert angle == pytest.approx(3 + 0.199 - 2 * math.pi, abs=2e-4)
    minutes = []
    for tick in (5_900, 11_900):  # a second before the next minute
        wire.host.simulation.ticks = tick
        minutes += readings_of(wire.wait(2), "MissionTime")
    counts = [each["Minutes"] for each in minutes]
    assert counts == ["0"] * 9 + ["1"] * (11 + 9) + ["2"] * 11


def test_normalized_speeds_are_percentages_and_all_are_limited(
    empty_room: Scene,
) -> None:
    wire = Wire(empty_room)
    wire.send("INIT {ClassName USARBot.AirRobot} {Location 0,0,-1}")
    wire.send(
        "DRIVE {AltitudeVelocity 10} {LinearVelocity -50} {LateralVelocity 25} "
        "{RotationalVelocity 0} {Normalized True}"
    )
    wire.wait(0.99)
    assert wire.body.position() == pytest.approx([-1.0, -0.5, 1.2])
    wire.send(fly(0, 99, 0, -99))
    wire.wait(0.49)
    assert wire.body.yaw == pytest.approx(math.radians(50))
    # As if it had wheels, which keeps its height.
    z = wire.body.z
    wire.send(fly(0, 0, 0, 0), "DRIVE {Left 1} {Right 1}")
    start = wire.body
    wire.wait(0.5)
    way = wire.body.position() - start.position()
    assert np.hypot(*way[:2]) == pytest.approx(0.5, abs=0.03)
    assert wire.body.z == z
    wire.send("DRIVE {Speed 3} {FrontSteer 1}")
    assert wire.news == [
        "DRIVE with Speed of AirRobot, which flies, expected AltitudeVelocity and "
        "LinearVelocity"
    ]


def slab(
    name: str, size: tuple[float, ...], at: tuple[float, ...], density: float = math.inf
) -> Part:
    vertices, faces = box(*size)
    return Part(name, Material(name, density=density), vertices + np.array(at), faces)


# A floor, a hedge of 2 m across x = 3, a roof at 5 m, and a shelf at 2.5 m next to it.
YARD = Scene(
    "yard",
    "DM-Yard",
    (
        slab("floor", (20, 20, 0.2), (0, 0, -0.1)),
        slab("hedge", (0.6, 20, 2), (3, 0, 1)),
        slab("roof", (20, 20, 0.2), (0, 0, 5.1)),
        slab("shelf", (2, 2, 0.05), (-4, 0, 2.5)),
    ),
    (StartPose("RobotStart1", Pose3(0, 0, 0)),),
)


def test_floor_roof_and_shelf_stop_it_and_touch() -> None:
    wire = Wire(YARD)
    wire.send("INIT {ClassName USARBot.AirRobot} {Start RobotStart1}")
    assert wire.body.z == pytest.approx(0.12)
    wire.send(fly(2, 0, 0, 0))
    lines = wire.wait(4)
    assert wire.body.z == pytest.approx(5 - 0.12)
    touches = [line for line in lines if "Touch" in line]
    assert touches[0].endswith("{Name Bumper Touch False}")
    assert touches[-1].endswith("{Name Bumper Touch True}")
    wire.send(fly(-2, 0, 0, 0))
    wire.wait(4)
    assert wire.body.z == pytest.approx(0.12)
    wire.send(fly(0, -2, 0, 0))
    wire.wait(2)
    wire.send(fly(2, 0, 0, 0))
    wire.wait(3)
    assert wire.body.z == pytest.approx(2.475 - 0.12)


def test_it_flies_over_a_hedge_that_stops_it_lower_and_cannot_land_in_it() -> None:
    wire = Wire(YARD)
    wire.send("INIT {ClassName USARBot.AirRobot} {Location 0,0,-1}")
    wire.send(fly(0, 2, 0, 0))
    wire.wait(2)
    assert wire.body.x == pytest.approx(2.7 - 0.5, abs=0.002)
    wire.send(fly(2, 0, 0, 0))
    wire.wait(0.8)
    wire.send(fly(0, 2, 0, 0))
    wire.wait(0.4)
    assert wire.body.x == pytest.approx(3.0, abs=0.05)
    wire.send(fly(-2, 0, 0, 0))
    wire.wait(2)
    assert wire.body.z == pytest.approx(2.12)
    wire.send(fly(0, 2, 0, 0))
    wire.wait(1)
    wire.send(fly(-2, 0, 0, 0))
    wire.wait(2)
    assert wire.body.z == pytest.approx(0.12)


def test_it_flies_over_a_robot_lands_on_it_and_rises_no_higher_than_the_air() -> None:
    sky = Scene("sky", "DM-Sky", YARD.parts[:1], YARD.starts)
    wire = Wire(sky)
    wire.send("INIT {ClassName USARBot.AirRobot} {Location -3,0,-1}")
    number = wire.host.connect()
    wire.host.receive(number, b"INIT {ClassName USARBot.P3AT} {Location 0,0,0}\r\n")
    drone, rover = wire.host.simulation.vehicles
    wire.send(fly(0, 2, 0, 0))
    wire.wait(1.5)
    assert drone.robot.pose.x == pytest.approx(0, abs=0.03)
    # Under it the other one drives as if it were not there.
    wire.host.receive(number, b"DRIVE {Left 2} {Right 2}\r\n")
    wire.send(fly(0, 0, 0, 0))
    wire.wait(0.5)
    assert rover.robot.pose.x == pytest.approx(0.5 * 2 * 0.098, abs=0.005)
    wire.host.receive(number, b"DRIVE {Left 0} {Right 0}\r\n")
    wire.send(fly(-1, 0, 0, 0))
    wire.wait(2)
    assert drone.robot.body.z == pytest.approx(0.46 + 0.12)
    wire.send(fly(2, 0, 0, 0))
    wire.wait(11)
    assert drone.robot.body.z == pytest.approx(20.0)


class BotArdrone:
    """A client of the AR.Drone: what it sends at first, and how it reads lines."""

    first = (
        "INIT {ClassName USARBot.ARDrone} {Name ARDrone} {Location -2.0,0.0,-1.1}",
        "SET {Type Viewports} {Config SingleView} {Viewport1 Camera2}",
        fly(0, 0, 0, 0),
    )

    def __init__(self) -> None:
        self.battery = 0
        self.altitudes: list[float] = []
        self.places: list[list[float]] = []
        self.accelerations: list[list[float]] = []

    def parse(self, line: str) -> None:
        head, kind = line[:3], line.partition("{Type ")[2].partition("}")[0]
        if head == "STA":
            self.battery = int(line.partition("{Battery ")[2].partition("}")[0])
        elif kind == "GroundTruth":
            self.places.append(self.three(line, "{Location "))
        elif kind == "Sonar":
            text = line.partition("Name Sonar1 Range ")[2]
            self.altitudes.append(float(text.partition("}")[0]))
        elif kind == "Accel":
            self.accelerations.append(self.three(line, "{Acceleration "))

    def three(self, line: str, key: str) -> list[float]:
        numbers = line.partition(key)[2].partition("}")[0].split(",")
        assert len(numbers) == 3
        return [float(number) for number in numbers]


def test_bot_ardrone_flies_for_a_while() -> None:
    wire, bot = Wire(YARD), BotArdrone()
    wire.send(*bot.first)
    for second in range(SECONDS):
        up = 0.5 if second % 8 < 2 else -0.5 if second % 8 in (4, 5) else 0.0
        side = 0.4 if second % 20 < 10 else -0.4
        wire.send(fly(up, 0, side, 0.5))
        for line in wire.wait(0.99):
            bot.parse(line)
        # Its sonar, five times a second, is in the middle of its hull.
        assert bot.altitudes[-1] == pytest.approx(wire.body.z, abs=0.11)
    assert len(bot.places) == 10 * SECONDS
    assert bot.places[-1] == pytest.approx(
        [wire.body.x, -wire.body.y, -wire.body.z], abs=0.01
    )
    rises = [each[2] for each in bot.accelerations]
    assert min(rises) < -4 < 4 < max(rises)  # of 0.5 m/s in 0.1 s, z downwards
    assert bot.battery == 3600 - SECONDS
    assert wire.news == []


def mrl_unit(line: str) -> list[list[float]] | None:
    """Read an IMU as MRL, by the rule of its others: segments by position."""
    if "{Type IMU}" not in line:
        return None
    segments = [each.split("}")[0] for each in line.split("{")[1:]]
    shift = 3 if segments[0].startswith("Time") else 2
    words = [each.split(" ") for each in segments[shift:]]
    keys = ["XYZAcceleration", "AngularVel", "AngularAccel", "Rotation"]
    assert [key for key, _ in words] == keys
    return [[float(number) for number in text.split(",")] for _, text in words]


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
def test_mrl_reads_the_inertial_unit_for_a_while(
    empty_room: Scene, dialect: Dialect
) -> None:
    wire = Wire(empty_room, dialect)
    wire.send("INIT {ClassName USARBot.AirRobot} {Location 0,0,-1}")
    rate = 0.5 if dialect is COMPAT else math.degrees(0.5)
    wire.send(fly(0, 0, 0, rate))
    lines = [line for _ in range(SECONDS) for line in wire.wait(1)]
    found = [mrl_unit(line) for line in lines]
    units = [each for each in found if each is not None]
    assert len(units) == 10 * SECONDS
    rates = [rates for _, rates, _, _ in units[1:]]
    assert rates == [pytest.approx([0, 0, 0.5], abs=2e-3)] * (10 * SECONDS - 1)
    turned = np.unwrap([angles[2] for *_, angles in units])
    assert turned[-1] - turned[0] == pytest.approx(0.5 * (SECONDS - 0.1), abs=1e-3)


def test_lcm_proxy_flies_an_air_robot_for_a_while() -> None:
    wire = Wire(YARD, UDK)
    wire.send(
        "INIT {ClassName USARBot.AirRobot} {Name A} {Location -2,0,-1} {Rotation 0,0,0}"
    )
    turned, scans = 0.0, 0
    for _ in range(SECONDS):
        before = wire.body.yaw
        wire.send(
            "DRIVE {AltitudeVelocity 0,00} {LinearVelocity 0,10} "
            "{LateralVelocity 0,00} {RotationalVelocity 30,00} {Normalized False}"
        )
        for line in wire.wait(0.99):
            found = re.search(r"\{Type RangeScanner\}.*\{Range ([^}]*)\}", line)
            scans += found is not None and len(found[1].split(",")) == 181
        turned += (before - wire.body.yaw) % (2 * math.pi)
    assert turned == pytest.approx(math.radians(30 * SECONDS), rel=1e-3)
    assert scans == 5 * SECONDS
    assert wire.body.z == pytest.approx(1.0)


BUSHES = Scene(
    "bushes",
    "DM-Bushes",
    (
        slab("floor", (40, 40, 0.2), (0, 0, -0.1)),
        slab("hedge", (0.6, 20, 2), (3, 0, 1), 0.3),
        slab("wall", (0.2, 40, 8), (9, 0, 4)),
    ),
    YARD.starts,
)


def test_over_a_hedge_a_laser_sees_what_a_radar_saw_through_it(tmp_path: Path) -> None:
    file = tmp_path / "both.yaml"
    file.write_text("""\
based_on: AirRobot
name: Both
items: [{type: RangeScanner, name: SICK, position: [0.1, 0, 0.1], sensor: sick}]
""")
    wire = Wire(BUSHES, COMPAT, read_robot(file))
    wire.send("INIT {ClassName USARBot.Both} {Location 0,0,0}", fly(1, 0, 0, 0))
    ahead: dict[str, dict[float, float]] = {"Hokuyo": {}, "SICK": {}}
    for _ in range(40):
        for line in wire.wait(0.1):
            found = re.search(
                r"{Type RangeScanner} {Name (\w+)}.*{Range ([^}]*)}", line
            )
            if found:
                z = wire.body.z + 0.1  # of the scanners
                ahead[found[1]][z] = float(found[2].split(",")[90])
    hedge, wall = 2.7 - 0.1, 8.9 - 0.1
    lasers = {z: r for z, r in ahead["SICK"].items() if abs(z - 2) > 0.05}
    for z, laser in lasers.items():
        assert laser == pytest.approx(hedge if z < 2 else wall, abs=0.02)
    low = [r for z, r in ahead["Hokuyo"].items() if z < 1.9]
    assert low == [pytest.approx(wall, abs=0.1)] * len(low)
    assert len(low) >= 15
    assert len(ahead["SICK"]) == 40


def test_a_new_drone_is_one_file(tmp_path: Path) -> None:
    file = tmp_path / "hexa.yaml"
    file.write_text("""\
name: Hexa
length: 0.8
width: 0.8
height: 0.3
origin_height: 0.15
mass: 3
max_torque: 1
flight: {max_linear: 10, max_lateral: 10, max_altitude: 4, max_turn_deg: 90}
items: [{type: RangeScanner, name: Roof, position: [0, 0, 0.2], sensor: sick}]
""")
    wire = Wire(YARD, COMPAT, read_robot(file))
    (conf,) = wire.send("INIT {ClassName USARBot.Hexa}", "GETCONF {Type Robot}")
    assert conf.endswith("{Name Hexa} {Mass 3.0000} {MaxSpeed 10.0000}")
    wire.send(fly(4, 0, 0, 0))
    lines = wire.wait(0.5)
    assert wire.body.z == pytest.approx(0.15 + 2.0, abs=0.05)
    assert any("{Name Roof}" in line for line in lines)


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ({"wheel_radius": 0.1}, "flight, or wheels"),
        ({"steering": {"max_front_deg": 30}}, "flight, or"),
        ({"flight": None}, "wheeled robots need"),
    ],
)
def test_what_flies_has_no_wheels(keys: dict[str, object], problem: str) -> None:
    model = load_robot("AirRobot")
    data = model.model_dump(exclude_unset=True) | keys
    with pytest.raises(ValueError, match=problem):
        type(model).model_validate(data)


def test_robot_on_wheels_refuses_to_fly(empty_room: Scene) -> None:
    wire = Wire(empty_room)
    wire.send("INIT {ClassName USARBot.P3AT}", fly(1, 1, 1, 1))
    assert wire.news == []  # one client stops any robot so
    (vehicle,) = wire.host.simulation.vehicles
    with pytest.raises(ValueError, match="P3AT does not fly"):
        vehicle.robot.fly(up=1.0)
