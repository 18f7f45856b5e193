"""Simulated versions of other clients, with the quirks of their framing and dialogues.

They run in lockstep with a host and read lines with the clients' own parsers. An
exception is where the real client would drop data, stall or crash.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from client_parsers import PlayerParser, RosParser
from positional_parsers import (
    IridiumParser,
    MaldoParser,
    StudentParser,
    ThafParser,
    ToolboxParser,
)

from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig


class Wire:
    """A host and one connection to it."""

    def __init__(self, host: Host) -> None:
        self.host = host
        self.number = host.connect()

    def send(self, text: str) -> None:
        self.host.receive(self.number, text.encode("ascii"))

    def writes(self, seconds: float) -> Iterator[bytes]:
        """Let time pass and yield each write of the server."""
        for tick in range(1 + round(seconds * 100)):
            if tick:
                self.host.step()
            data = self.host.take(self.number)
            if data:
                yield data

    def lines(self, seconds: float) -> Iterator[str]:
        for data in self.writes(seconds):
            assert data.endswith(b"\r\n")
            yield from data.decode("ascii").split("\r\n")[:-1]

    @property
    def x(self) -> float:
        """The x coordinate of the robot, m."""
        (vehicle,) = self.host.simulation.vehicles
        return vehicle.robot.pose.x


@pytest.fixture
def wire(empty_room: Scene) -> Wire:
    return Wire(Host(empty_room))


@dataclass
class RosNode:
    """Has one open request of each type; drives when robot and sensors are known."""

    wire: Wire
    parser: RosParser = field(default_factory=RosParser)
    infos: dict[str, set[str]] = field(
        default_factory=lambda: {"CONF": set(), "GEO": set()}
    )
    asked: dict[str, str | None] = field(
        default_factory=lambda: {"CONF": None, "GEO": None}
    )
    seen: set[tuple[str, str]] = field(default_factory=lambda: {("Robot", "")})
    limits: tuple[float, float] = (0.0, 0.0)
    steering: dict[str, float] = field(default_factory=dict)
    scans: int = 0
    poses: int = 0
    driven: bool = False

    def run(self, seconds: float) -> None:
        self.wire.send(
            "GETSTARTPOSES\r\nINIT {Classname USARBot.P3AT} {Name R1} "
            "{Start RobotStart1}\r\nGETCONF {Type RFID}\r\nGETGEO {Type RFID}\r\n"
        )
        for line in self.wire.lines(seconds):
            self.handle(line)
            self.ask()

    def ask(self) -> None:
        for verb, asked in self.asked.items():
            unknown = sorted(
                (kind, name)
                for kind, name in self.seen
                if f"{kind} {name}".strip() not in self.infos[verb]
            )
            if asked is None and unknown:
                kind, name = unknown[0]
                self.asked[verb] = f"{kind} {name}".strip()
                self.wire.send(f"GET{verb} {{Type {kind}}} {{Name {name}}}\r\n")
        if not self.driven and len(self.seen) > 1 and self.knows_all():
            speed = min(self.steering["MaxSpeed"], 0.264 / self.steering["WheelRadius"])
            self.wire.send(f"Drive {{Left {speed:f}}} {{Right {speed:f}}}\r\n")
            self.driven = True

    def knows_all(self) -> bool:
        wanted = {f"{kind} {name}".strip() for kind, name in self.seen}
        return all(infos >= wanted for infos in self.infos.values())

    def handle(self, line: str) -> None:
        reading = self.parser.parse(line)
        if reading is None or reading.kind == "STA":
            return
        verb, _, kind = reading.kind.rpartition(" ")
        if not verb:
            self.seen.add((kind, reading.name))
            self.poses += reading.name == "GndTruth"
            self.scans += kind == "RangeScanner"
            return
        self.infos[verb].add(self.asked[verb] or "")
        self.asked[verb] = None
        if kind == "Robot":
            self.steering |= reading.values
        elif (verb, kind) == ("CONF", "RangeScanner"):
            self.limits = (reading.values["MinRange"], reading.values["MaxRange"])


def test_the_ros_node_learns_its_robot_and_drives(wire: Wire) -> None:
    node = RosNode(wire)
    node.run(6)
    kinds = {kind for kind, _ in node.seen}
    assert kinds >= {"Robot", "RangeScanner", "GroundTruth", "INS", "Encoder", "Touch"}
    assert node.knows_all()
    assert node.steering == {
        "WheelRadius": 0.098,
        "WheelSeparation": 0.36,
        "MaxSpeed": 8.17,
    }
    assert node.limits == (0.1, 80)
    assert node.scans >= 55
    assert node.poses >= 55
    assert wire.x > -7


@dataclass
class PlayerDriver:
    """Has a line buffer of 4096 bytes and parses only lines with a name."""

    wire: Wire
    buffer: bytes = b""
    parser: PlayerParser = field(default_factory=lambda: PlayerParser("P2AT"))
    readings: dict[str, list[Mapping[str, Any]]] = field(default_factory=dict)

    def run(self, seconds: float) -> None:
        for data in self.wire.writes(seconds):
            for i in range(len(data)):  # one byte at a time
                self.buffer += data[i : i + 1]
                assert len(self.buffer) < 4096
                if self.buffer.endswith(b"\n"):
                    self.handle(self.buffer.decode("ascii").strip())
                    self.buffer = b""

    def handle(self, line: str) -> None:
        reading = self.parser.parse(line)
        if reading is not None:
            self.readings.setdefault(reading.kind, []).append(reading.values)


def test_the_player_driver_gets_its_geometry_and_scans(wire: Wire) -> None:
    driver = PlayerDriver(wire)
    wire.send(
        "INIT {ClassName USARBot.P2AT} {Name p2} {Location -8.000000 1.000000 0.200000}"
        " {Rotation 0.000000 0.000000 0.000000}\r\n"
        "GETCONF {Type Robot}\r\nGETGEO {Type Robot}\r\n"
        "GETGEO {Type RangeScanner}\r\nGETCONF {Type RangeScanner}\r\n"
        "DRIVE {Left 2.000000} {Right 2.000000}\r\n"
    )
    driver.run(1)
    wire.send("SET {Type Odometry} {Name Odometry} {Opcode RESET} \r\n\n\r")
    driver.run(1)
    assert driver.readings["GEO Robot"][0]["WheelRadius"] == [0.11]
    assert driver.readings["CONF Robot"][0]["MaxSpeed"] == 8.17
    assert driver.readings["GEO RangeScanner"] == [{"Location": [0.15, 0, -0.2]}]
    scans = [values["Range"] for values in driver.readings["RangeScanner"]]
    assert len(scans) >= 18
    # the first range is the right one, from y = 1 to the wall at y = 6.4
    assert scans[0][0] == pytest.approx(5.4, abs=0.02)
    assert scans[0][-1] == pytest.approx(7.4, abs=0.02)
    distances = [values["Pose"][0] for values in driver.readings["Odometry"]]
    assert max(distances[:10]) == pytest.approx(0.2, abs=0.03)
    assert max(distances[11:]) == pytest.approx(0.2, abs=0.03)


class JavaController:
    """Drops one byte for each line that it reads.

    The bytes are missing at the start of the next write, whose first line loses as many
    bytes as the write before it had lines.
    """

    def __init__(self, wire: Wire) -> None:
        self.wire = wire
        self.owed = 1  # the greeting
        self.lost: list[str] = []
        self.parser = MaldoParser()
        self.readings: dict[str, list[Mapping[str, Any]]] = {}

    def run(self, seconds: float) -> None:
        self.wire.host.take(self.wire.number)  # the greeting
        for data in self.wire.writes(seconds):
            lines = data.decode("ascii").split("\r\n")[:-1]
            mangled = lines[0][min(self.owed, len(lines[0])) :]
            self.owed = len(lines)
            for line in [mangled, *lines[1:]]:
                self.handle(line)
            self.lost.append(lines[0])

    def handle(self, line: str) -> None:
        reading = self.parser.parse(line)
        if reading is not None:
            self.readings.setdefault(reading.kind, []).append(reading.values)


def test_the_java_controller_loses_only_the_status(wire: Wire) -> None:
    java = JavaController(wire)
    wire.send(
        "INIT {ClassName USARBot.P2AT} {Name 1} {Location -8,169998 5,700001 -2,250000}"
        " {Rotation 0,000000 0,000000 0,000000}\r\n"
    )
    java.run(2)
    assert len(java.lost) == 20
    assert all(line.startswith("STA {Type GroundVehicle}") for line in java.lost)
    for kind in ("RangeScanner", "GroundTruth", "INS", "Odometry", "Touch"):
        assert len(java.readings[kind]) == 20
    assert java.readings["Touch"][0] == {"Touch": False}
    x, _, _ = java.readings["GroundTruth"][-1]["Location"]
    assert x == pytest.approx(wire.x, abs=1e-4)
    assert wire.x == pytest.approx(-8.169998)


def position_3d(up: float, ahead: float, side: float, turn: float) -> str:
    """Return a command of maldo's flight, as its Spanish locale writes it."""
    texts = [f"{each:f}".replace(".", ",") for each in (up, ahead, side, turn)]
    keys = ("Altitude", "Linear", "Lateral", "Rotational")
    fields = [f"{{{k}Velocity {t}}}" for k, t in zip(keys, texts, strict=True)]
    return f"DRIVE {' '.join(fields)} {{Normalized false}}\r\n"


def test_the_java_controller_flies_for_a_while(wire: Wire) -> None:
    java = JavaController(wire)
    wire.send(
        "INIT {ClassName USARBot.AirRobot} {Name 1} {Location -6,000000 1,000000 "
        "-0,250000} {Rotation 0,000000 0,000000 0,000000}\r\nGETCONF {Type Robot}\r\n"
    )
    java.run(0.2)
    for second in range(20):
        x, y, z = java.readings["GroundTruth"][-1]["Location"]
        yaw = java.readings["GroundTruth"][-1]["Orientation"][2]
        # It rises to 2 m first, and then keeps on a circle to the right.
        up = max(-0.5, min(0.5, 2.0 + z))
        turn = 0.5 if second >= 5 else 0.0
        wire.send(position_3d(up, 1.0 if turn else 0.0, 0.0, turn))
        java.run(1.0)
        assert abs(yaw) <= 3.1416
        assert ((x, y) == (-6.0, 1.0)) is (second <= 5)
    body = wire.host.simulation.vehicles[0].robot.body
    read = java.readings["GroundTruth"][-1]["Location"]
    assert read == pytest.approx([body.x, -body.y, -body.z], abs=1e-4)
    assert body.z == pytest.approx(2.0, abs=0.01)
    # A circle of 2 m to the right of where it was: y of the wire is from 1 to 5.
    ys = [values["Location"][1] for values in java.readings["GroundTruth"]]
    assert (min(ys), max(ys)) == pytest.approx((1.0, 5.0), abs=0.03)
    assert len(java.readings["RangeScanner"]) == pytest.approx(202, abs=2)
    assert len(java.readings["GPS"]) == pytest.approx(101, abs=2)
    assert java.readings["Touch"][-1] == {"Touch": False}


class Iridium:
    """Its panels: actuators that it has learnt of, positions of links, a map."""

    stop = (
        "DRIVE {Left 0} {Right 0} {Speed 0} {AltitudeVelocity 0} {LinearVelocity 0} "
        "{LateralVelocity 0} {RotationalVelocity 0}\r\n"
    )

    def __init__(self, wire: Wire, class_name: str) -> None:
        self.wire = wire
        self.actuators: list[str] = []
        self.links: dict[str, dict[int, float]] = {}
        self.track: list[tuple[float, float, float]] = []
        self.battery = 0
        self.parser = IridiumParser()
        wire.send(
            f"INIT {{ClassName USARBot.{class_name}}} {{Location 0.00, 0.00, 0.00}} "
            "{Rotation 0.00, 0.00, 0.00}\r\n"
        )
        self.run(0.2)
        wire.send("GETCONF {Type Actuator}\r\n")
        self.run(0.1)

    def run(self, seconds: float) -> None:
        for line in self.wire.lines(seconds):
            reading = self.parser.parse(line)
            if reading is None:
                continue
            match reading.kind:
                case "STA":
                    self.battery = reading.values["Battery"]
                case "MISSTA":
                    self.links[reading.name] = reading.values["Links"]
                case "CONF Actuator" if not self.actuators:
                    keys = ("Name", "Name_0")
                    values = reading.values
                    self.actuators = [values[key] for key in keys if key in values]
                case "GroundTruth":
                    x, y, _ = reading.values["Location"]
                    self.track.append((x, y, reading.values["Orientation"][2]))
                case _:
                    pass


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
def test_iridium_turns_a_pan_tilt_for_a_while(
    empty_room: Scene, dialect: Dialect
) -> None:
    wire = Wire(Host(empty_room, config=SimulationConfig(dialect)))
    ui = Iridium(wire, "Kenaf")
    assert ui.actuators == ["Flippers", "CameraPanTilt"]
    for second in range(20):
        pan, tilt = 0.5 * np.sin(second / 10), 0.2
        wire.send(f"ACT {{Name CameraPanTilt}} {{Link 1}} {{Value {pan:.4f}}}\r\n")
        wire.send(f"ACT {{Name CameraPanTilt}} {{Link 2}} {{Value {tilt:.4f}}}\r\n")
        ui.run(1.0)
        (vehicle,) = wire.host.simulation.vehicles
        if second > 5:  # it turns at 0.17 rad/s
            seen = vehicle.camera_pose(vehicle.cameras[0])
            assert (seen.yaw, -seen.pitch) == pytest.approx((pan, tilt), abs=0.01)
            if dialect is COMPAT:  # the lines of the other are not shown
                shown = {0: pan, 1: tilt}
                assert ui.links["CameraPanTilt"] == pytest.approx(shown, abs=0.01)
    assert [*ui.links] == (["Flippers", "CameraPanTilt"] if dialect is COMPAT else [])
    assert len(ui.track) == pytest.approx(203, abs=2)


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
def test_iridium_steers_a_car_for_a_while(empty_room: Scene, dialect: Dialect) -> None:
    wire = Wire(Host(empty_room, config=SimulationConfig(dialect)))
    ui = Iridium(wire, "FrontAckerman")
    assert ui.actuators == []
    unit = 1.0 if dialect is UDK else 2 * np.pi
    for second in range(20):
        steer = 0.3 if second % 20 < 10 else 0.15
        wire.send(
            f"DRIVE {{Speed {0.3 * unit:.2f}}} {{FrontSteer {steer:.2f}}} "
            "{RearSteer 0.00} {Light true}\r\n"
        )
        ui.run(1.0)
    (vehicle,) = wire.host.simulation.vehicles
    speed = round(0.3 * unit, 2) / unit * 2 * np.pi * 0.128
    turned = np.unwrap([yaw for *_, yaw in ui.track])
    rates = np.tan([0.3, 0.15]) / 0.956 * speed
    # To the right, by the bicycle model, from the first command on.
    assert turned[-1] - turned[0] == pytest.approx(10 * rates.sum(), rel=0.005)
    steps = np.hypot(*np.diff([(x, y) for x, y, _ in ui.track], axis=0).T)
    assert steps[5:].max() < 1.1 * speed / 10
    wire.send(Iridium.stop)
    where = vehicle.robot.pose
    ui.run(1.0)
    assert vehicle.robot.pose == where
    battery = 3600 if dialect is COMPAT else 1200
    assert ui.battery == pytest.approx(battery - 21, abs=1)


class MatlabToolbox:
    """Searches the next 1000 lines for a reading; stops after 0.5 s without data."""

    def __init__(self, wire: Wire) -> None:
        self.wire = wire
        self.parser = ToolboxParser()

    def find(self, kind: str) -> Mapping[str, Any]:
        reading = self.parser.parse(self.find_line(kind))
        assert reading is not None
        return reading.values

    def find_line(self, kind: str) -> str:
        silence, count = 0.0, 0
        while count < 1000:
            lines = list(self.wire.lines(0.05))
            silence = 0 if lines else silence + 0.05
            assert silence < 0.5
            for line in lines:
                count += 1
                if f"Type {kind}" in line:
                    return line
        raise AssertionError(f"no {kind} within 1000 lines")


def test_the_matlab_toolbox_finds_every_reading(wire: Wire) -> None:
    toolbox = MatlabToolbox(wire)
    wire.send(
        "INIT {ClassName USARBot.P3AT} {Name R1} {Location -8,1.9,1.8} "
        "{Rotation 0,0,1.5708}\r\n"
    )
    for kind in ("Odometry", "GroundTruth", "INS", "RangeScanner"):
        assert toolbox.find(kind)
    for command in (
        "DRIVE {Left 1} {Right 1} {Normalized False}",
        "DRIVE {Flip True}",
        "DRIVE {Name FRFlipper} {Value 0.5}",
        "DRIVE {Speed 1} {FrontSteer 0.2} {Normalized True}",
        "MISPKG {Name CameraPanTilt} {Link 1} {Value 0.1} {Order 0}",
        "DRIVE {Light True}",
    ):
        wire.send(f"{command}\r\n")
    list(wire.writes(1))
    truth = toolbox.find("GroundTruth")
    assert truth["Orientation"] == [0, 0, 1.5708]
    # right of x, at yaw 90 degrees right
    assert truth["Location"][1] == pytest.approx(1.9 + 0.1, abs=0.02)
    assert "{LightToggle True}" in toolbox.find_line("GroundVehicle")


def test_a_student_client_reads_fields_by_position(wire: Wire) -> None:
    wire.send("INIT {ClassName USARBot.P2DX} {Location -8,1.9,1.8} {Name R1}\r\n")
    parser, counts = StudentParser(), Counter[str]()
    for data in wire.writes(3):
        assert len(data) <= 4096  # one recv(4096) ...
        assert data.endswith(b"\n")  # ... that ends with a line
        for line in data.decode("ascii").splitlines():
            reading = parser.parse(line)
            if reading is not None:
                counts[reading.kind] += 1
            wire.send("DRIVE {LEFT 20} {RIGHT 10} {Normalized true}\r\n")
    assert counts["STA"] >= 29
    for kind in ("RangeScanner", "Odometry"):
        assert counts[kind] >= 14
    (vehicle,) = wire.host.simulation.vehicles
    assert vehicle.robot.pose.yaw < -0.5  # the left wheels are faster: it turns right


class Ap2dxReflex:
    """AP2DX's reflex: stops before what comes near one of its eight sonars.

    It compares each range with the one before. A line of more sonars is beyond the end
    of its arrays.
    """

    def __init__(self) -> None:
        self.ranges = [0.0] * 8

    def is_stopped_by(self, line: str) -> bool:
        """Return whether something comes near; the outermost sonars do not count."""
        found = re.findall(r"\{Name \w+ Range ([0-9.,_-]+)\}", line)
        before, self.ranges = self.ranges, [float(text) for text in found]
        return any(
            self.ranges[i] < 0.3 and self.ranges[i] < before[i]
            for i in range(1, len(self.ranges) - 1)
        )


def test_ap2dx_drives_until_its_reflex_stops_it(wire: Wire) -> None:
    """Its planner takes less than 10 mm between two readings of the INS for stuck."""
    wire.send("INIT {ClassName USARBot.P2DX} {Location 7.5,0,0} {Name R1}\r\n")
    reflex, places, is_stopped = Ap2dxReflex(), list[float](), False
    wire.send("DRIVE {Left 1.0} {Right 1.0}\r\n")
    for line in wire.lines(60):
        if "{Type INS}" in line and not is_stopped:
            places.append(float(line.partition("{Location ")[2].split(",")[0]))
        if "{Type Sonar}" in line and reflex.is_stopped_by(line):
            is_stopped = True
            wire.send("DRIVE {Left 0} {Right 0}\r\n")
    steps = np.diff(places)
    assert steps[1:].min() > 0.01
    assert wire.x == pytest.approx(10.4 - 0.3 - 0.21, abs=0.03)


def test_thaf_reads_eight_sonars_by_position(wire: Wire) -> None:
    wire.send("INIT {ClassName USARBot.P2DX} {Location -8,1.9,1.8} {Name R1}\r\n")
    wire.send("DRIVE {Left 1.0} {Right 1.0}\r\n")
    parser = ThafParser()
    read = [r for r in map(parser.parse, wire.lines(10)) if r is not None]
    assert len(read) == 50
    assert min(map(min, read)) > 0.1
    assert wire.x > -7.3


def test_a_student_client_may_send_one_wheel_or_decimal_commas(wire: Wire) -> None:
    wire.send("INIT {ClassName USARBot.P2DX} {Location -8,0000, 0,0000, 0,0000}\r\n")
    wire.send("DRIVE {Left 1.0}\r\n")
    list(wire.writes(1))
    assert wire.x == -8
    wire.send("DRIVE {LEFT -1.0} {RIGHT -1.0}\r\n")
    list(wire.writes(1))
    assert wire.x == pytest.approx(-8 - 0.0825)
