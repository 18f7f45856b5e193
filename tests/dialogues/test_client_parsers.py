"""Every line of a minute of each robot, as the clients in the field parse it.

The robot drives a circle in the empty room, in which the range of every beam is known:
it is compared with what each client reads.
"""

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from client_parsers import Parser, PlayerParser, Reading, RosParser
from positional_parsers import (
    IridiumParser,
    LcmProxyParser,
    MaldoParser,
    StudentParser,
    ToolboxParser,
)
from usarcommander_parser import UsarCommanderParser

import radarsim
from radarsim.client import Session
from radarsim.geometry import Floats, Pose3
from radarsim.presets.robots import load_robot, read_robot, robot_names
from radarsim.protocol.dialect import COMPAT, RAD_PER_S, UDK, Dialect
from radarsim.scene.scene import GPS_ORIGIN, Scene
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

HALF_LENGTH, HALF_WIDTH = 10.4, 6.4  # m; between the walls of the empty room
# Of classes that UsarCommander does not know, nobody mounts a scanner for it.
UNKNOWN_MODELS = ("Kurt2D", "Sedan", "FrontAckerman", "BasicAckermanRobot")
ASKED = (
    *("Robot", "RangeScanner", "GroundTruth", "INS", "Odometry", "Tachometer"),
    *("Encoder", "Touch", "Sonar", "GPS"),
)
# m; the least and the largest difference of the truth and the written value. The rays
# of a sonar miss the nearest point of a wall by up to 0.2 mm.
ROUNDING = {"compat": (-0.0051, 0.0051), "udk": (-3e-4, 0.0101)}
SONAR_CONE = np.radians(np.linspace(-10, 10, 201))
SONAR_LIMITS = (0.1, 5.0)  # m
MAX_INCIDENCE = 75.0  # degrees
LEFT, RIGHT = 2.0, 3.0  # rad/s
MOST_BEAMS = {
    "P3AT_Radar360": 360,
    "P3AT_Compare360": 360,
    "P3AT_Navtech": 401,
    "P3AT_Hokuyo": 228,
    "P3AT_Compare": 228,
}


def parsers_for(class_name: str, dialect: Dialect) -> dict[str, Parser]:
    """Return the parsers of all clients that work with a robot and a dialect."""
    model = load_robot(class_name)
    parsers: dict[str, Parser] = {"Iridium": IridiumParser()}
    if class_name not in UNKNOWN_MODELS and not class_name.startswith("pioneer"):
        parsers["UsarCommander"] = UsarCommanderParser(class_name)
    if model.flight is not None:  # other clients only read robots on the ground
        if dialect is COMPAT and not model.items_of("Sonar"):
            parsers["maldo"] = MaldoParser()
        return parsers | {"LcmProxy": LcmProxyParser()}
    beams = MOST_BEAMS.get(class_name, 181)
    # It takes the quotient of rounded angles for exact, which it is for whole degrees.
    if beams <= LcmProxyParser.LARGEST_ARRAY and (beams == 181 or dialect is UDK):
        parsers["LcmProxy"] = LcmProxyParser()
    if beams <= RosParser.MOST_BEAMS:
        parsers["usarsim_inf"] = RosParser()
    if dialect is COMPAT:
        parsers["AUT toolbox"] = ToolboxParser()
        if len(model.items_of("Sonar")) in (0, 16):
            parsers["maldo"] = MaldoParser()
        if model.generation == "ut2004":
            parsers["Player"] = PlayerParser(class_name)
            parsers["student"] = StudentParser()
    return parsers


@dataclass
class Tick:
    """The lines of one tick, and where the robot was."""

    lines: list[str]
    pose: Pose3


class Robot:
    """A robot that drives a circle, and all that its server sends."""

    def __init__(self, scene: Scene, class_name: str, dialect: Dialect) -> None:
        model = load_robot(class_name)
        exact = {
            item.name: {"side_offset_uu": 0}
            for item in model.items
            if item.sensor == "radar"
        }
        self.config = SimulationConfig(dialect, item_settings=exact)
        self.host = Host(scene, config=self.config)
        self.number = self.host.connect()
        self.checked: set[str] = set()  # kinds that were compared with the truth
        asked = [f"GET{v} {{Type {kind}}}" for kind in ASKED for v in ("GEO", "CONF")]
        factor = 1 / RAD_PER_S[dialect.drive_unit]
        left, right = LEFT * factor, RIGHT * factor
        sides = f"{{Left {left:f}}} {{Right {right:f}}}"
        car = f"{{Speed {left:.2f}}} {{FrontSteer 0.20}} {{RearSteer -0.20}}"  # Iridium
        is_car = model.steering is not None
        lines = (
            f"INIT {{ClassName USARBot.{class_name}}} {{Start RobotStart1}}",
            "GETSTARTPOSES",
            *asked,
            f"DRIVE {car if is_car else sides}",
        )
        self.host.receive(self.number, "\r\n".join([*lines, ""]).encode())

    def ticks(self, seconds: float) -> Iterator[Tick]:
        """Let time pass; yield the sent bytes, tick by tick."""
        for _ in range(round(100 * seconds)):
            self.host.step()
            data = self.host.take(self.number).decode("ascii")
            (vehicle,) = self.host.simulation.vehicles
            yield Tick(data.split("\r\n")[:-1], vehicle.robot.body)

    def check(self, reading: Reading, pose: Pose3) -> None:
        """Compare a scan, sonars, a true pose or a GPS with the truth."""
        read: Any = reading.values.get("Range")
        if reading.kind == "Sonar" and read:
            sonars = read if isinstance(read, dict) else {reading.name: read[0]}
            errors = self.true_sonars(sonars, pose) - list(sonars.values())
        elif isinstance(reading.values.get("Latitude"), tuple):
            errors = self.errors_on_globe(reading.values, pose)
        elif reading.name == "Navtech":
            return  # its ranges have noise, and its beams a width
        elif reading.kind == "RangeScanner":
            errors = self.true_ranges(reading, pose) - read
        elif reading.kind == "GroundTruth" and "Location" in reading.values:
            truth = (pose.x, -pose.y, -pose.z)
            errors = np.abs(np.array(truth)) - np.abs(reading.values["Location"])
        else:
            return
        low, high = ROUNDING[self.config.dialect.name]
        assert low < errors.min() <= errors.max() < high, reading
        self.checked.add(reading.kind)

    def errors_on_globe(self, values: Mapping[str, Any], pose: Pose3) -> Floats:
        """Return how far latitude and longitude are beyond the error of a GPS, (2,) m.

        The error is that of five standard deviations, of the antenna's place on the
        robot, and of rounding.
        """
        allowed = 5 * 0.33 + 0.5 + 0.2
        beyond = []
        for key, origin, scale, metres in zip(
            ("Latitude", "Longitude"),
            GPS_ORIGIN,
            (111_200, 71_670),
            (pose.x, -pose.y),
            strict=True,
        ):
            degrees, minutes, side = values[key]
            angle = (degrees + minutes / 60) * (1 if side in "NE" else -1)
            off = abs((angle - origin) * scale - metres)
            beyond.append(max(off - allowed, 0.0))
        return np.array(beyond)

    def true_sonars(self, names: Iterable[str], pose: Pose3) -> Floats:
        """Return the distances to the nearest walls that face sonars, (S,) m."""
        (vehicle,) = self.host.simulation.vehicles
        mounts = {item.name: item.mount for item in vehicle.model.items_of("Sonar")}
        truth = []
        for name in names:
            sensor = pose.compose(mounts[name])
            if sensor.pitch > 1:  # down to the floor
                truth.append(sensor.z)
                continue
            angles = sensor.yaw + SONAR_CONE
            is_facing = np.cos(np.radians(MAX_INCIDENCE)) <= facing(sensor, angles)
            is_facing[len(angles) // 2] = True  # the axis counts at any incidence
            truth.append(room_ranges(sensor, angles)[is_facing].min())
        clipped: Floats = np.clip(truth, *SONAR_LIMITS)
        return clipped

    def true_ranges(self, reading: Reading, pose: Pose3) -> Floats:
        """Return the distances to the walls along the beams of a scan, (N,) m."""
        (vehicle,) = self.host.simulation.vehicles
        items = vehicle.model.items_of("RangeScanner")
        item = next(item for item in items if reading.name in ("", item.name))
        settings = self.config.scanner_settings(item)
        sensor = pose.compose(item.mount)
        count = len(reading.values["Range"])
        angles = np.radians(settings.resolution_deg) * np.arange(count)
        angles += sensor.yaw - math.radians(settings.fov_deg) / 2
        return np.minimum(room_ranges(sensor, angles), settings.max_range)


def room_ranges(sensor: Pose3, angles: Floats) -> Floats:
    """Return the distances to the walls of the empty room, (N,) m."""
    ranges = np.full(len(angles), math.inf)
    for place, half, steps in (
        (sensor.x, HALF_LENGTH, np.cos(angles)),
        (sensor.y, HALF_WIDTH, np.sin(angles)),
    ):
        with np.errstate(divide="ignore"):
            reach = (np.copysign(half, steps) - place) / steps
        ranges = np.minimum(ranges, reach)
    return ranges


def facing(sensor: Pose3, angles: Floats) -> Floats:
    """Return the cosines of incidence on the walls of the empty room, (N,)."""
    along, across = np.abs(np.cos(angles)), np.abs(np.sin(angles))
    ranges = room_ranges(sensor, angles)
    x = sensor.x + ranges * np.cos(angles)
    return np.where(np.isclose(np.abs(x), HALF_LENGTH), along, across)


def is_registered(parser: Parser, kind: str, name: str) -> bool:
    """Return whether a client reads a sensor of that name."""
    scanner = getattr(parser, "scanner", name)
    return kind != "RangeScanner" or name == scanner


@pytest.mark.parametrize("seconds", [1.5, pytest.param(60, marks=pytest.mark.slow)])
@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
@pytest.mark.parametrize("class_name", robot_names())
def test_clients_parse_every_line_and_read_true_ranges(
    empty_room: Scene, class_name: str, dialect: Dialect, seconds: float
) -> None:
    """Let every client parse every line, and compare what they read with the truth."""
    robot = Robot(empty_room, class_name, dialect)
    parsers = parsers_for(class_name, dialect)
    own = Session()
    sent: Counter[tuple[str, str]] = Counter()
    read: dict[str, Counter[str]] = {client: Counter() for client in parsers}
    for tick in robot.ticks(seconds):
        for line in tick.lines:
            assert len(line) + 2 <= 4095  # of one read of most clients
            own.receive(f"{line}\r\n".encode("ascii"))
            sent.update(re.findall(r"^SEN .*?{Type (\w+)} {Name (\w+)", line))
            for client, parser in parsers.items():
                if (reading := parser.parse(line)) is not None:
                    robot.check(reading, tick.pose)
                    read[client][reading.kind] += 1
    assert own.unread == 0
    assert robot.checked >= {"RangeScanner", "GroundTruth"}
    for kind in ("Sonar", "GPS"):
        is_read = any(kind in parser.sensors for parser in parsers.values())
        # In this form only the drone's own client reads it, in a test of its own.
        is_read &= (kind, class_name, dialect) != ("Sonar", "ARDrone", COMPAT)
        is_carried = bool(load_robot(class_name).items_of(kind))
        assert (kind in robot.checked) is (is_read and is_carried)
    for client, parser in parsers.items():
        wanted = Counter(
            kind
            for kind, name in sent.elements()
            if kind in parser.sensors and is_registered(parser, kind, name)
        )
        assert {k: n for k, n in read[client].items() if k in wanted} == wanted, client
        assert wanted["RangeScanner"] >= seconds / 0.31, client


SCAN = "SEN {Type RangeScanner} {Name Scanner1} {Resolution 1} {FOV 1} {Range 1,2}"


@pytest.mark.parametrize(
    ("parser", "line"),
    [
        (MaldoParser(), "SEN {Type Touch} {Name B} {Touch False}"),
        (StudentParser(), "SEN {Time 1} {Type Odometry} {Name O} {Pose 1,2,3}"),
        (UsarCommanderParser("P2AT"), SCAN.replace("1,2", "1,")),
        (RosParser(), "SEN {Time 1} {Type RangeScanner} {Range 1,2} {Name S} {FOV 1}"),
        (
            PlayerParser("P2AT"),
            "GEO {Type RangeScanner} {Name Scanner1} {Location 1,2,3}",
        ),
        (PlayerParser("P2AT"), SCAN.replace("Scanner1", "lms200")),
        (PlayerParser("P2AT"), "SEN {Time 1} {Type Encoder} {Name ECLeft Tick 3}"),
        (
            MaldoParser(),
            "SEN {Type GPS} {Name G} {Fix 1} {Satellites 5} {Latitude 1,2.5,N}",
        ),
        (LcmProxyParser(), SCAN.replace("1,2", "1,2,3")),
        (ToolboxParser(), "SEN {Type GPS} {Name G} {Fix 1}"),
    ],
)
def test_parsers_fail_where_their_clients_do(parser: Parser, line: str) -> None:
    with pytest.raises((AssertionError, IndexError, KeyError, ValueError)):
        parser.parse(line)


def test_class_of_the_manual_is_quiet_for_usarsim_inf(
    empty_room: Scene, tmp_path: Path
) -> None:
    page = (Path(radarsim.__file__).parent / "docs/protocol.md").read_text()
    found = re.search(r"```yaml\n(# quiet.yaml\n.*?)```", page, re.DOTALL)
    assert found
    file = tmp_path / "quiet.yaml"
    file.write_text(found[1])
    warnings = {}
    for model in (load_robot("P3AT"), read_robot(file)):
        host = Host(empty_room, config=SimulationConfig(robots=(model,)))
        number = host.connect()
        init = f"INIT {{ClassName USARBot.{model.name}}} {{Start RobotStart1}}\r\n"
        host.receive(number, init.encode())
        for _ in range(200):
            host.step()
        lines = host.take(number).decode().splitlines()
        readings = [RosParser().parse(line) for line in lines if line[:3] == "SEN"]
        kinds = Counter(reading.kind for reading in readings if reading)
        assert kinds.keys() >= RosParser.published
        warnings[model.name] = sum(
            count for kind, count in kinds.items() if kind not in RosParser.published
        )
    assert warnings == {"P3AT": 2 * 50, "Quiet": 0}
