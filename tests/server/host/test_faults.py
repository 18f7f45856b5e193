"""Errors of single robots, and numbers at the limits of what commands may have."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot, robot_names
from radarsim.protocol import line_template
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.protocol.line_template import Block
from radarsim.protocol.reports import StartPoses
from radarsim.raycast.rays import Rays
from radarsim.robots.robot import Robot
from radarsim.scene.scene import Scene
from radarsim.sensors.gps import GpsReceiver
from radarsim.server.host import Host
from radarsim.server.host.connection import SendQueue
from radarsim.server.host.lockstep import InProcessTransport
from radarsim.simulation.config import SimulationConfig
from radarsim.simulation.vehicle import Vehicle

INITS = (
    b"INIT {ClassName AirRobot} {Name good} {Location -2,0,-1}\r\n",
    b"INIT {ClassName AirRobot} {Name bad} {Location 60,0,-1}\r\n",
)
NUMBERS = ("0", "1", "-1", "3e7", "-3e7", "1e9", "-1e9", "3.1415927", "1e-9")
DRIVES = (
    *("Left", "Right", "Speed", "FrontSteer", "RearSteer", "AltitudeVelocity"),
    *("LinearVelocity", "LateralVelocity", "RotationalVelocity", "Value"),
)


def fail_for(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a method that fails for a robot, or for the lines of the one at 60 m."""

    def method(*args: Any) -> Any:
        lines = b"".join(each for each in args if isinstance(each, bytes))
        if name in _names(args) or b"{Location 60.0" in lines:
            raise ArithmeticError("a bug")
        return function(*args)

    return method


def _names(values: Any) -> list[str]:
    if isinstance(values, list | tuple):
        return [name for each in values for name in _names(each)]
    robot = getattr(values, "vehicle", values)
    robot = getattr(robot, "robot", robot)
    return [robot.name] if hasattr(robot, "fleet") else []


def play(scene: Scene, ticks: int = 40) -> tuple[Host, list[bytes]]:
    """Return what the clients of two robots are sent, and close as a server does."""
    host = Host(scene)
    numbers = [host.connect() for _ in INITS]
    data = [b"", b""]
    for number, init in zip(numbers, INITS, strict=True):
        host.receive(number, init + b"DRIVE {AltitudeVelocity .1}\r\n")
    for _ in range(ticks):
        host.step()
        for k, number in enumerate(numbers):
            data[k] += host.take(number)
    return host, data


@pytest.mark.parametrize(
    ("owner", "name"),
    [
        (Vehicle, "due"),
        (Vehicle, "sensor_pose"),
        (Robot, "tilt"),
        (SendQueue, "put_readings"),
        (GpsReceiver, "rays"),
        (GpsReceiver, "read"),  # that of the other has drawn its random numbers before
    ],
)
def test_error_of_one_robot_ends_that_robot_alone(
    empty_room: Scene, monkeypatch: pytest.MonkeyPatch, owner: type, name: str
) -> None:
    _, (undisturbed, _) = play(empty_room)
    monkeypatch.setattr(owner, name, fail_for("bad", getattr(owner, name)))
    host, (good, bad) = play(empty_room)
    assert good == undisturbed
    assert bad.splitlines()[-1].startswith(b"NFO {Error an error in the server, which")
    assert bad.endswith(b"ArithmeticError('a bug')}\r\n")
    assert [vehicle.robot.name for vehicle in host.simulation.vehicles] == ["good"]
    assert [host.fault(number) is None for number in (1, 2)] == [True, False]
    assert "ArithmeticError: a bug" in host.close_reason(2)
    fault = host.fault(2)
    assert isinstance(fault, ArithmeticError)
    assert fault.__notes__ == ["of client 2, robot 'bad'"]
    assert host.receive(2, b"GETSTARTPOSES\r\n") == []
    host.disconnect(2)
    host.step()
    with pytest.raises(KeyError):
        host.close_reason(2)


def test_invalid_rays_of_one_robot_end_that_robot_alone(
    empty_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    def rays(sensor: GpsReceiver) -> Rays:
        valid = whole(sensor)
        is_bad = sensor.robot.name == "bad"
        return replace(valid, origins=valid.origins * np.nan) if is_bad else valid

    whole = GpsReceiver.rays
    _, (undisturbed, _) = play(empty_room)
    monkeypatch.setattr(GpsReceiver, "rays", rays)
    host, (good, bad) = play(empty_room)
    assert good == undisturbed
    assert b"expected finite numbers" in bad.splitlines()[-1]
    assert [host.fault(number) is None for number in (1, 2)] == [True, False]


def test_line_that_cannot_be_written_ends_that_robot_alone(
    empty_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    def encode(blocks: list[Block]) -> list[bytes]:
        if any(59.0 < each < 61.0 for block in blocks for each in block[3]):
            raise ArithmeticError("a bug")  # at the place of the robot
        return whole(blocks)

    whole = line_template.encode_blocks
    _, (undisturbed, _) = play(empty_room)
    monkeypatch.setattr("radarsim.server.host.host.encode_blocks", encode)
    host, (good, _) = play(empty_room)
    assert good == undisturbed
    assert [host.fault(number) is None for number in (1, 2)] == [True, False]


def test_error_of_a_command_ends_that_client_alone(
    empty_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    host = Host(empty_room)
    one, other = host.connect(), host.connect()
    for number in (one, other):
        host.take(number)

    def fail(*_: object) -> None:
        raise ArithmeticError("a bug")

    with monkeypatch.context() as patch:
        patch.setattr(StartPoses, "encode", fail)
        assert host.receive(one, b"GETSTARTPOSES\r\n" * 9) == []
    assert host.fault(one) is not None
    assert not host.is_busy(one)
    assert host.receive(other, b"GETSTARTPOSES\r\n") == []
    host.step()
    assert host.take(one).startswith(b"NFO {Error ")
    assert host.take(other).startswith(b"NFO {StartPoses ")
    with pytest.raises(ArithmeticError, match="a bug"):
        host.raise_fault()


def test_error_is_raised_where_server_and_client_are_one_program(
    empty_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    transport = InProcessTransport(Host(empty_room))
    transport.send(INITS[1])
    transport.receive(0.1)
    monkeypatch.setattr(Vehicle, "due", fail_for("bad", Vehicle.due))
    with pytest.raises(ArithmeticError, match="a bug"):  # noqa: PT012 - in one of them
        for _ in range(100):
            transport.receive(1.0)


def test_error_of_a_robot_without_a_client_is_raised(
    empty_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    host = Host(empty_room)
    assert host.simulation.spawn("bad", load_robot("P3AT"), Pose2(0.0, 0.0))
    monkeypatch.setattr(Vehicle, "due", fail_for("bad", Vehicle.due))
    with pytest.raises(ArithmeticError, match="a bug"):  # noqa: PT012 - in one of them
        for _ in range(100):
            host.step()


TRIPLES = st.tuples(*[st.sampled_from(NUMBERS)] * 3).map(",".join)
COMMANDS = st.one_of(
    st.dictionaries(st.sampled_from(DRIVES), st.sampled_from(NUMBERS), min_size=1).map(
        lambda each: "DRIVE " + " ".join(f"{{{k} {v}}}" for k, v in each.items())
    ),
    st.builds(
        "MISPKG {{Name CameraPanTilt}} {{Link {}}} {{Value {}}} {{Order {}}}".format,
        st.integers(0, 3),
        st.sampled_from(NUMBERS),
        st.integers(0, 4),
    ),
    st.builds(
        "SET {{Type INS}} {{Opcode POSE}} {{Params {},{}}}".format, TRIPLES, TRIPLES
    ),
    st.sampled_from(["1e-3", "1000", "0.1", "-1"]).map(
        "SET {{Type RangeScanner}} {{Opcode SETTING}} {{Params max_range={}}}".format
    ),
)
QUICK = settings(
    max_examples=3,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(each, marks=() if each == "ARDrone" else pytest.mark.slow)
        for each in robot_names()
    ],
)
@QUICK
@given(TRIPLES, TRIPLES, st.lists(COMMANDS, min_size=1, max_size=8))
def test_numbers_at_their_limits_end_no_robot(
    empty_room: Scene,
    dialect: Dialect,
    name: str,
    place: str,
    angles: str,
    commands: list[str],
) -> None:
    host = Host(empty_room, config=SimulationConfig(dialect))
    number = host.connect()
    init = f"INIT {{ClassName {name}}} {{Location {place}}} {{Rotation {angles}}}\r\n"
    host.receive(number, init.encode())
    for tick in range(200):
        if tick % 10 == 5:
            line = commands[tick // 10 % len(commands)] + "\r\n"
            host.receive(number, line.encode())
        host.step()
        host.take(number)
        host.raise_fault()


@pytest.mark.parametrize("name", ["ARDrone", "AirRobot", "Kenaf"])
@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
def test_many_turns_in_an_init_are_no_rate(
    empty_room: Scene, dialect: Dialect, name: str
) -> None:
    """They are no turn of the robot, whose rate an IMU would divide by a tick."""
    host = Host(empty_room, config=SimulationConfig(dialect))
    init = f"INIT {{ClassName {name}}} {{Location 0,0,-1}} {{Rotation 0,0,3e7}}\r\n"
    number = host.connect()
    host.receive(number, init.encode() + b"DRIVE {RotationalVelocity 1}\r\n")
    for _ in range(30):
        host.step()
        host.raise_fault()
        (vehicle,) = host.simulation.vehicles
        assert abs(vehicle.robot.pose.yaw) <= 3.1416
        assert host.fault(number) is None
