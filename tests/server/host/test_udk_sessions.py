"""Whole sessions in the ``udk`` dialect."""

import re
from dataclasses import replace

import pytest

from radarsim.presets.robots import robot_names
from radarsim.protocol.dialect import UDK
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

OWN_TYPES = ("Odometry", "Touch")  # of no P3AT of the original
INIT = b"INIT {ClassName USARBot.P3AT} {Location -8,0,0}\r\n"


@pytest.fixture
def host(empty_room: Scene) -> Host:
    return Host(empty_room, config=SimulationConfig(UDK))


def spawned(host: Host, init: bytes = INIT) -> int:
    number = host.connect()
    host.take(number)
    host.receive(number, init)
    return number


def run(host: Host, number: int, ticks: int) -> list[str]:
    lines: list[str] = []
    for _ in range(ticks):
        host.step()
        lines += host.take(number).decode("ascii").split("\r\n")[:-1]
    return lines


def x_of(host: Host) -> float:
    return host.simulation.vehicles[0].robot.pose.x


def test_lines_of_the_first_two_tenths_of_a_second(host: Host) -> None:
    number = spawned(host)
    assert run(host, number, 9) == []
    first = run(host, number, 1)
    assert first == [
        "STA {Time 0.1000} {Battery 1199} {Type GroundVehicle} {LightToggle False} "
        "{LightIntensity 100} {FrontSteer 0} {RearSteer 0}",
        "SEN {Time 0.1000} {Type GroundTruth} {Name GndTruth} "
        "{Location -8.000,0.000,-0.146} {Orientation 0.000,0.000,0.000}",
        "SEN {Time 0.1000} {Type Encoder} {Name W1} {Tick 0}",
        "SEN {Time 0.1000} {Type Encoder} {Name W2} {Tick 0}",
    ]
    second = run(host, number, 10)
    assert len(second) == len(first) + 3
    assert second[2] == (
        "SEN {Type INS} {Name InsTest} {Location -8.00,0.00,-0.35} "
        "{Orientation 0.00,0.00,0.00}"
    )
    assert second[3].startswith(
        "SEN {Time 0.2000} {Type Tachometer} {Name TachTest} "
        "{Vel 0.0000,0.0000,0.0000,0.0000} {Pos "
    )
    scan = second[-1]
    head = "SEN {Time 0.2000} {Type RangeScanner} {Name lms200} {Resolution 0.0174} "
    assert scan.startswith(head + "{FOV 3.1414} {Range 6.")
    ranges = re.findall(r"[0-9.]+", scan.split("{Range ")[1])
    assert len(ranges) == 181
    assert max(float(r) for r in ranges) <= 20


@pytest.mark.parametrize(
    "class_name", [name for name in robot_names() if name.startswith(("P2", "P3"))]
)
def test_p3at_carries_what_the_original_mounts(host: Host, class_name: str) -> None:
    init = f"INIT {{ClassName USARBot.{class_name}}} {{Location -8,0,0}}\r\n"
    number = spawned(host, init.encode())
    asked = [f"GET{v} {{Type {t}}}" for v in ("GEO", "CONF") for t in OWN_TYPES]
    host.receive(number, "\r\n".join([*asked, ""]).encode())
    text = "\n".join(run(host, number, 30))
    is_p3at = class_name.startswith("P3AT")
    for kind in OWN_TYPES:
        verbs = re.findall(rf"^(\w+) .*{{Type {kind}}}", text, re.MULTILINE)
        assert set(verbs) == (set() if is_p3at else {"GEO", "CONF", "SEN"})
    has_touch = "{Type Touch} {Name Bumper} {Touch False}" in text
    assert has_touch is not is_p3at
    assert f"{{Name {'GndTruth' if is_p3at else 'GroundTruth'}}}" in text


@pytest.mark.parametrize(
    ("class_name", "ticks"), [("P3AT", 20), ("P3AT_SICK", 20), ("P3AT_Hokuyo", 30)]
)
def test_scanners_have_the_rates_of_usarsim(
    host: Host, class_name: str, ticks: int
) -> None:
    init = f"INIT {{ClassName USARBot.{class_name}}} {{Location -8,0,0}}\r\n"
    number = spawned(host, init.encode())
    lines = run(host, number, 60)
    times = [line[:18] for line in lines if "{Type RangeScanner}" in line]
    assert times == [
        f"SEN {{Time {tick / 100:.4f}}} " for tick in range(ticks, 61, ticks)
    ]


@pytest.mark.parametrize("class_name", ["P3AT", "P3AT_SICK"])
def test_radar_and_sick_reach_20_m(host: Host, class_name: str) -> None:
    init = f"INIT {{ClassName USARBot.{class_name}}} {{Location 500,0,0}}\r\n"
    number = spawned(host, init.encode())
    (scan,) = [line for line in run(host, number, 20) if "RangeScanner" in line]
    assert scan.count("20.00") == 181


def test_drive_is_in_revolutions_per_second_and_limited(host: Host) -> None:
    number = spawned(host)
    host.receive(number, b"DRIVE {Left 5} {Right 5}\r\n")
    lines = run(host, number, 100)
    assert x_of(host) == pytest.approx(-8 + 0.8005, abs=1e-3)
    tachometer = [line for line in lines if "Tachometer" in line][-1]
    assert "{Vel 8.1681,8.1681,8.1681,8.1681}" in tachometer
    host.receive(number, b"DRIVE {Left -0.5} {Right -0.5}\r\n")
    run(host, number, 100)
    assert x_of(host) == pytest.approx(-8 + 0.8005 - 0.3079, abs=1e-3)


def test_only_the_status_is_sent_after_the_battery_runs_out(empty_room: Scene) -> None:
    weak = replace(UDK, battery_start=2.0)  # s; the real 20 minutes take too long
    host = Host(empty_room, config=SimulationConfig(weak))
    number = spawned(host)
    host.receive(number, b"DRIVE {Left 0.1} {Right -0.1} {Light true}\r\n")
    before = run(host, number, 100)
    assert "{Battery 1}" in [line for line in before if line.startswith("STA")][-1]
    assert before[-1].startswith("SEN")
    run(host, number, 99)
    pose = host.simulation.vehicles[0].robot.pose
    (status,) = run(host, number, 1)
    assert status.startswith("STA {Time 2.0000} {Battery 0}")
    (first, second) = host.receive(
        number, b"DRIVE {Left 1} {Right 1} {Light false}\r\nGETGEO {Type Robot}\r\n"
    )
    assert first.kind == second.kind == "battery"
    assert first.text == "DRIVE to a robot with an empty battery has no effect"
    after = run(host, number, 100)
    assert len(after) == 10
    assert all(line.startswith("STA ") and "{Battery 0}" in line for line in after)
    assert "{LightToggle True}" in after[-1]
    assert host.simulation.vehicles[0].robot.pose.yaw == pytest.approx(
        pose.yaw, abs=1e-2
    )
    stopped = host.simulation.vehicles[0].robot.pose
    run(host, number, 10)
    assert host.simulation.vehicles[0].robot.pose == stopped
    assert host.receive(number, INIT) == []  # the new robot has a full battery
    assert "{Battery 1}" in run(host, number, 10)[0]
