"""A loop in this process reads what clients of a server read, by the same commands."""

import logging
import math

import numpy as np
import pytest

import radarsim
from radarsim.client import Client
from radarsim.client.robot_info import no_return
from radarsim.client.robot_state import EchoCollector
from radarsim.client.session import Session
from radarsim.errors import ClientError, PortUnavailable
from radarsim.local import LocalRobot, LocalSimulation, simulate
from radarsim.protocol import reports
from radarsim.protocol.reports import RangeScan, Report
from radarsim.scene.scene import Scene
from radarsim.server.host import Host

RADIUS, SEPARATION = 0.098, 0.36  # m, of a P3AT
STARTS = "RobotStart1", "RobotStart2"


@pytest.fixture
def sim(foliage_room: Scene) -> LocalSimulation:
    return simulate(foliage_room, seed=3)


def wheel_speeds(speed: float, turn: float) -> tuple[float, float]:
    """Return rad/s of the left and right wheels of a P3AT."""
    across = turn * SEPARATION / 2
    return (speed - across) / RADIUS, (speed + across) / RADIUS


def numbers_of(report: Report) -> list[object]:
    if isinstance(report, RangeScan):
        return [report.time, report.name, *report.ranges.tolist()]
    return [report]


class WireRobot:
    """A client of a host that writes lines itself."""

    def __init__(self, host: Host, start: str) -> None:
        self.host, self.number = host, host.connect()
        self.session = Session()
        init = f"INIT {{ClassName USARBot.P3AT}} {{Start {start}}}\r\n"
        assert host.receive(self.number, init.encode()) == []

    def drive(self, left: float, right: float) -> None:
        line = f"DRIVE {{Left {left:.17f}}} {{Right {right:.17f}}}\r\n"
        self.host.receive(self.number, line.encode())

    def read(self) -> list[Report]:
        return self.session.receive(self.host.take(self.number))


def test_two_robots_report_what_a_server_sends(
    foliage_room: Scene, sim: LocalSimulation
) -> None:
    host = Host(foliage_room, seed=3)
    wired = [WireRobot(host, start) for start in STARTS]
    robots = [sim.spawn("P3AT", start=start) for start in STARTS]
    for each in wired:
        each.read()  # the greeting
    kinds: set[str] = set()
    for k in range(150):
        motions = [(0.4, 0.1), (0.3, -0.2 * math.sin(k / 20))]
        for robot, wire, motion in zip(robots, wired, motions, strict=True):
            robot.drive(*motion)
            wire.drive(*wheel_speeds(*motion))
        sim.step(0.1)
        for _ in range(10):
            host.step()
        for robot, wire in zip(robots, wired, strict=True):
            sent = wire.read()
            received = [r for r in robot.reports if type(r).__name__ != "Greeting"]
            assert list(map(numbers_of, received)) == list(map(numbers_of, sent))
            kinds |= {type(report).__name__ for report in sent}
    assert sim.time == host.simulation.time == 15.0
    assert {"RangeScan", "GroundTruth", "Ins", "Odometry", "Touch"} <= kinds


def test_lasers_in_smoke_read_the_same_here_and_from_a_server(
    smoke_room: Scene,
) -> None:
    """All read the same depths, and the first are those of the item's generator."""
    config = radarsim.SimulationConfig(item_settings={"lms200": {"sensor": "physical"}})
    host = Host(smoke_room, seed=3, config=config)
    sim = simulate(smoke_room, seed=3, config=config)
    wired = [WireRobot(host, start) for start in STARTS]
    robots = [sim.spawn("P3AT", start=start) for start in STARTS]
    sim.step(1.0)
    for _ in range(100):
        host.step()
    for robot, wire in zip(robots, wired, strict=True):
        sent = [each for each in wire.read() if isinstance(each, RangeScan)]
        read = [each for each in robot.reports if isinstance(each, RangeScan)]
        assert list(map(numbers_of, read)) == list(map(numbers_of, sent))
        rng = radarsim.generator_for(3, robot.name, "lms200")
        pose = (robot.pose.x, robot.pose.y, robot.pose.yaw)
        alone = radarsim.load_sensor("physical").scan(smoke_room, pose, rng).ranges
        assert 0 < np.median(alone) < 1  # inside the smoke, not at a wall
        np.testing.assert_allclose(sent[0].ranges, alone, rtol=0, atol=0.006)


def test_properties_are_the_newest_reports(sim: LocalSimulation) -> None:
    robot = sim.spawn(start="robotstart1", name="R1")
    assert sim.robots == {"R1": robot}
    robot.drive_wheels(2.0, 2.0)
    sim.step(1.0)
    newest = {type(report): report for report in robot.reports}
    assert robot.truth is newest[reports.GroundTruth]
    assert robot.ins is newest[reports.Ins]
    assert robot.odometry is newest[reports.Odometry]
    assert robot.touch is newest[reports.Touch]
    wheels = robot.newest(reports.Tachometer, "tachtest")
    assert wheels.velocities[0] == pytest.approx(2.0)
    assert robot.newest(RangeScan, "LMS200") is robot.scan()
    assert robot.odometry.pose.x == pytest.approx(2.0 * RADIUS * 1.0, abs=1e-4)
    assert (robot.pose.x, robot.pose.y) == pytest.approx(
        (robot.truth.pose.x, robot.truth.pose.y), abs=1e-4
    )
    robot.stop()
    sim.step(0.5)
    assert robot.newest(reports.Tachometer).velocities == (0.0,) * 4


def test_points_of_a_laser_lie_on_the_walls_in_every_frame(empty_room: Scene) -> None:
    sim = simulate(empty_room)
    robot = sim.spawn("P3AT_SICK", pose=(2.0, 1.0, 0.7))
    robot.drive(0.2, turn=0.3)
    sim.step(2.0)
    scan = robot.scan()
    assert scan.ranges.max() < no_return(scan.max_range)  # all come back
    points = scan.points("map")
    lows, highs = empty_room.bounds[:, :2]
    # The room has one wall on each side: the nearest is a centimetre away, rounded.
    inner = np.minimum(np.abs(points - lows - 0.1), np.abs(points - highs + 0.1))
    assert inner.min(axis=1).max() < 0.12
    near, far = scan.points("scanner"), scan.points("robot")
    np.testing.assert_allclose(np.hypot(*near.T), scan.ranges, rtol=1e-12)
    mount = robot.info.scanner().mount
    np.testing.assert_allclose(far - near, np.tile([mount.x, mount.y], (181, 1)))
    # The odometer begins where the robot began, and knows no wall.
    c, s = math.cos(0.7), math.sin(0.7)
    turned = scan.points("odometry") @ np.array([[c, s], [-s, c]]) + (2.0, 1.0)
    np.testing.assert_allclose(turned, points, atol=2e-3)
    assert np.abs(scan.points("ins") - points).max() < 0.5


def test_beams_without_return_give_no_points(empty_room: Scene) -> None:
    config = radarsim.SimulationConfig(item_settings={"lms200": {"max_range": 3.0}})
    sim = simulate(empty_room, config=config)
    robot = sim.spawn("P3AT_SICK", pose=(8.0, 0.0, 0.0))
    sim.step(0.1)
    scan = robot.scan()
    beyond = scan.ranges >= 3.0
    assert 0 < beyond.sum() < 181
    assert len(scan.points()) == (~beyond).sum()


def test_echoes_are_those_of_the_lines_before_the_scan(sim: LocalSimulation) -> None:
    robot = sim.spawn("P3AT", start="RobotStart1")
    sim.step(0.1)
    assert robot.scan().echoes is None
    robot.request_echoes("lms200")
    sim.step(0.1)
    collector = EchoCollector()
    for report in robot.reports:
        if isinstance(report, reports.EchoLine):
            collector.take(report)
    assert robot.scan().echoes
    assert robot.scan().echoes == collector.of(robot.scan())
    robot.request_echoes("lms200", on=False)
    sim.step(0.1)
    assert robot.scan().echoes is None


def test_targets_of_a_detector_come_with_its_scan(sim: LocalSimulation) -> None:
    robot = sim.spawn("P3AT_Navtech", start="RobotStart1")
    sim.step(1.0)
    assert robot.scan("navtech").targets is None
    robot.request_targets("navtech")
    sim.step(0.5)
    scan = robot.scan("Navtech")
    assert scan.targets
    assert {turn.time for turn in scan.targets} == {scan.time}
    assert len(scan.targets) == scan.targets[0].lines


def test_frame_that_a_robot_does_not_have_is_an_error(sim: LocalSimulation) -> None:
    robot = sim.spawn()
    sim.step(0.1)
    with pytest.raises(ValueError, match="did you mean 'map'"):
        robot.scan().points("mpa")  # type: ignore[arg-type]


def test_place_that_is_taken_is_an_error_and_leaves_no_robot(
    sim: LocalSimulation,
) -> None:
    def fill() -> None:
        for _ in range(20):
            sim.spawn(start="RobotStart1")

    with pytest.raises(ClientError, match="expected a free place within 1 m"):
        fill()
    assert len(sim.host.simulation.vehicles) == len(sim.robots) < 20


def test_robot_that_is_moved_to_a_free_place_is_reported(
    sim: LocalSimulation, caplog: pytest.LogCaptureFixture
) -> None:
    first = sim.spawn(start="RobotStart1")
    with caplog.at_level(logging.WARNING):
        second = sim.spawn(start="RobotStart1")
    assert first.pose != second.pose
    assert "the nearest free place" in caplog.text
    # The search delays the next robot by some ticks, as on a server.
    assert sim.time == 0.0
    sim.spawn(start="RobotStart2")
    assert sim.time == 0.04


def test_commands_beyond_the_limit_of_a_tick_wait_for_the_next(
    sim: LocalSimulation, caplog: pytest.LogCaptureFixture
) -> None:
    robot = sim.spawn()
    for k in range(25):
        robot.drive(k / 100)
    robot.send(b"DRIVE {Left 1}\r\n")  # waits, and has no effect
    sim.step(0.01)
    assert "DRIVE without Right" in caplog.text


def test_robot_can_be_removed(sim: LocalSimulation) -> None:
    one, two = sim.spawn(name="one"), sim.spawn(name="two")
    one.remove()
    sim.step(0.2)
    assert list(sim.robots) == ["two"]
    assert [v.robot.name for v in sim.host.simulation.vehicles] == ["two"]
    assert two.truth.time == 0.2


def test_texts_name_robots_and_time(sim: LocalSimulation) -> None:
    assert repr(sim) == "<LocalSimulation foliage_room at 0.00 s: no robots>"
    robot = sim.spawn(name="R1", pose=(-7.79, 0.0, 0.5))
    sim.step(0.25)
    assert repr(sim) == "<LocalSimulation foliage_room at 0.25 s: R1>"
    assert repr(robot) == "<LocalRobot R1: P3AT at (-7.79, 0.00, 0.50)>"


def test_client_of_the_library_drives_the_robot(sim: LocalSimulation) -> None:
    robot = sim.spawn()
    sim.step(0.5)
    client = robot.as_client()
    info = client.robot_info()
    assert info.length == robot.info.length
    assert info.wheel_speeds(0.3, 0.1) == robot.info.wheel_speeds(0.3, 0.1)
    before = sim.time
    scan = client.wait_for(RangeScan, name="lms200")
    assert scan.time == sim.time > before
    assert scan.ranges.tolist() == robot.scan().ranges.tolist()
    with pytest.raises(ClientError, match="did you mean 'max_range'"):
        client.change_settings(max_rnge=4.0)
    client.close()
    assert "R" in robot.name or robot.name in sim.robots


def test_silence_of_a_client_is_a_timeout_of_simulated_time(
    sim: LocalSimulation,
) -> None:
    client = sim.spawn().as_client()
    before = sim.time
    with pytest.raises(ClientError, match="no Gps within 2 s"):
        client.wait_for(reports.Gps, timeout=2.0)
    assert sim.time == pytest.approx(before + 2.0)


@pytest.fixture
def served(sim: LocalSimulation) -> "tuple[LocalSimulation, LocalRobot, int]":
    return sim, sim.spawn(name="inside"), sim.serve(0)[1]


def test_client_beside_sees_the_robots_of_the_loop(
    served: "tuple[LocalSimulation, LocalRobot, int]",
) -> None:
    sim, robot, port = served
    with sim, Client.connect("127.0.0.1", port) as client:
        client.watch()
        assert client.wait_for(reports.RobotJoined).robot == "inside"
        client.spawn("P3AT", name="outside", start="RobotStart2")
        robot.drive(0.3)
        before = sim.time
        sim.step(0.5)
        assert sim.time >= before + 0.5
        assert robot.odometry.pose.x > 0.05
        names = {vehicle.robot.name for vehicle in sim.host.simulation.vehicles}
        assert names == {"inside", "outside"}
        third = sim.spawn(name="later", start="RobotStart3")
        assert third.as_client().wait_for(RangeScan).time > before
        third.remove()
        with pytest.raises(ValueError, match="already served"):
            sim.serve(0)
    after = sim.time
    sim.step(0.1)  # by itself again
    assert sim.time == pytest.approx(after + 0.1)


def test_port_that_is_taken_is_an_error(
    served: "tuple[LocalSimulation, LocalRobot, int]", empty_room: Scene
) -> None:
    sim, _, port = served
    with sim, simulate(empty_room) as other:
        with pytest.raises(PortUnavailable):
            other.serve(port)
        other.step(0.1)
        assert other.time == 0.1


def test_failure_of_the_server_ends_the_step(
    served: "tuple[LocalSimulation, LocalRobot, int]", monkeypatch: pytest.MonkeyPatch
) -> None:
    sim, robot, _ = served

    def fail(_: bytes) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(robot, "add", fail)
    with pytest.raises(ExceptionGroup, match="usarsim_server failed"):
        sim.step(10.0)
    with pytest.raises(ExceptionGroup, match="usarsim_server failed"):
        robot.drive(0.1)


def test_a_car_drives_the_curve_that_is_asked_for() -> None:
    with radarsim.simulate("empty_room", seed=0) as sim:
        car = sim.spawn("Sedan", pose=(-4.0, -2.0))
        car.drive(1.0, turn=0.1)
        sim.step(4.0)
        assert car.pose.yaw == pytest.approx(0.4, abs=0.01)
        way = math.hypot(car.pose.x + 4.0, car.pose.y + 2.0)
        assert way == pytest.approx(20 * math.sin(0.2), rel=0.02)


def test_a_drone_rises_and_turns() -> None:
    with radarsim.simulate("empty_room", seed=0) as sim:
        drone = sim.spawn("AirRobot", pose=(0.0, 0.0))
        drone.fly(ahead=0.5, up=0.25, turn=0.5)
        sim.step(2.0)
        assert drone.truth.pose.z == pytest.approx(0.12 + 0.5, abs=0.01)
        assert drone.pose.yaw == pytest.approx(1.0, abs=0.01)
        drone.drive(0.0)
        drone.fly()
        z = drone.truth.pose.z
        sim.step(1.0)
        assert drone.truth.pose.z == pytest.approx(z, abs=0.01)
        with pytest.raises(ValueError, match="up in m/s"):
            drone.fly(up=math.inf)
