"""``Client`` with a host in simulated time; its numbers are those of the presets."""

import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from math import dist, pi

import numpy as np
import pytest

from radarsim.addons.testing import UsarsimServer
from radarsim.client import Client, ClientError, ClientTimeout
from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot, robot_names
from radarsim.protocol import reports
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.host.lockstep import InProcessTransport
from radarsim.simulation.config import SimulationConfig

from .conftest import DEADLINE, Serve


@pytest.mark.parametrize("name", sorted(robot_names()))
def test_robot_info_matches_the_robot_class(empty_room: Scene, name: str) -> None:
    model = load_robot(name)
    with Client(InProcessTransport(Host(empty_room))) as client:
        client.spawn(name, start="RobotStart1")
        info = client.robot_info()
        scans = [client.wait_for(reports.RangeScan, name=s.name) for s in info.scanners]
    hull = (info.length, info.width, info.height)
    assert hull == pytest.approx(model.dimensions)
    assert (info.wheel_radius, info.wheel_separation) == pytest.approx(
        (model.wheel_radius, model.wheel_separation)
    )
    own = model.max_rev_per_s
    spin = 8.17 if own is None else 2 * pi * own  # rad/s
    if model.flight is not None:
        spin = model.flight.max_linear
    assert info.top_speed == pytest.approx(spin * model.wheel_radius, rel=1e-3)
    for scanner, item, scan in zip(
        info.scanners, model.items_of("RangeScanner"), scans, strict=True
    ):
        assert (scanner.name, scanner.mount) == (item.name, item.mount)
        assert len(scan.ranges) == scanner.beams
        assert scan.ranges.max() <= round(scanner.max_range, 2)  # as on the wire


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=lambda dialect: dialect.name)
def test_robot_moves_at_the_commanded_speeds(
    empty_room: Scene, dialect: Dialect
) -> None:
    host = Host(empty_room, config=SimulationConfig(dialect))
    with Client(InProcessTransport(host)) as client:
        client.spawn("P3AT", pose=Pose2(0, 0, 0.5))
        info = client.robot_info(drive_unit=dialect.drive_unit)
        client.drive(*info.wheel_speeds(0.4, 0.5))
        start = client.wait_for(reports.GroundTruth)
        while (now := client.wait_for(reports.GroundTruth)).time < start.time + 2:
            pass
        seconds = now.time - start.time
        assert now.pose.yaw - start.pose.yaw == pytest.approx(0.5 * seconds, abs=0.02)
        chord = np.hypot(now.pose.x - start.pose.x, now.pose.y - start.pose.y)
        assert chord == pytest.approx(2 * 0.8 * np.sin(0.25 * seconds), abs=0.02)
        assert client.stop()
        client.read()
        still = client.wait_for(reports.GroundTruth).pose
        later = client.wait_for(reports.GroundTruth).pose
        assert (later.x, later.y, later.yaw) == (still.x, still.y, still.yaw)
    assert not host.simulation.collect_reports()


@pytest.mark.usarsim(speed=5)
def test_threads_get_each_what_they_wait_for(usarsim_server: UsarsimServer) -> None:
    with (
        Client.connect(port=usarsim_server.port, timeout=30) as client,
        ThreadPoolExecutor() as threads,
    ):
        client.spawn("P3AT", start="RobotStart1")

        def times(kind: type[reports.SensorReport]) -> list[float]:
            return [client.wait_for(kind).time for _ in range(10)]

        series = [
            threads.submit(times, kind)
            for kind in (reports.RangeScan, reports.Odometry)
        ]
        for each in series:  # a busy machine drops some of them, and repeats none
            periods = np.diff(each.result()) / 0.1
            assert periods.min() > 0.8
            assert periods == pytest.approx(np.round(periods), abs=0.11)
        waiting = threads.submit(times, reports.RangeScan)
        for _ in range(20):
            assert isinstance(client.geometry("RangeScanner"), reports.ItemGeo)
            client.drive(1.0, 1.0)
        assert len(waiting.result()) == 10
        with pytest.raises(ClientTimeout, match=r"no RobotLeft within 0\.1 s"):
            client.wait_for(reports.RobotLeft, timeout=0.1)
        assert client.session.unread == 0


@pytest.mark.parametrize("threads", [1, 3])
def test_close_ends_the_calls_of_other_threads(serve: Serve, threads: int) -> None:
    is_over = threading.Event()

    def be_silent(_: socket.socket) -> None:
        is_over.wait(DEADLINE)  # and leave the connection open

    client = Client.connect(port=serve(be_silent), timeout=2 * DEADLINE)
    with ThreadPoolExecutor() as pool:
        waiting = [
            pool.submit(client.wait_for, reports.RobotLeft) for _ in range(threads)
        ]
        looping = pool.submit(list, client)
        time.sleep(0.2)  # until they wait
        client.close()
        for each in waiting:
            with pytest.raises(ClientError, match=r"^the connection is closed while"):
                each.result(DEADLINE)
        assert looping.result(DEADLINE) == []
        is_over.set()


class Blind:
    """A link of a process that gives no reasons, as none of a network does."""

    def __init__(self, host: Host) -> None:
        link = InProcessTransport(host)
        self.send, self.receive = link.send, link.receive
        self.time, self.close = link.time, link.close


def test_spawn_of_an_unknown_class_times_out_in_simulated_time(
    empty_room: Scene,
) -> None:
    host = Host(empty_room)
    with Client(Blind(host), timeout=2) as client:
        expected = r"no reading of the robot 'Tank' within 2 s, the last line was 'NFO"
        with pytest.raises(ClientTimeout, match=expected):
            client.spawn("Tank")
        assert host.simulation.time == pytest.approx(2)
        with pytest.raises(ClientTimeout, match=r"within 0\.5 s.* no such class"):
            client.spawn("Tank", timeout=0.5)
        client.spawn("P3AT")
        assert isinstance(client.read()[0], reports.Status)


def test_robots_without_a_start_take_the_first_free_ones(foliage_room: Scene) -> None:
    host = Host(foliage_room)
    with ExitStack() as stack:
        for _ in range(4):
            client = stack.enter_context(Client(InProcessTransport(host)))
            client.spawn("P3AT")
            client.spawn("P3AT")  # its own place is free again
        poses = [vehicle.robot.pose for vehicle in host.simulation.vehicles]
    starts = [(start.pose.x, start.pose.y) for start in foliage_room.starts]
    assert [(pose.x, pose.y) for pose in poses[:3]] == starts
    # None is free any more: the nearest place to the first.
    assert 0.3 < dist((poses[3].x, poses[3].y), starts[0]) <= 1.0


def test_start_that_the_map_does_not_have_is_an_error(empty_room: Scene) -> None:
    host = Host(empty_room)
    with Client(InProcessTransport(host)) as client:
        with pytest.raises(ClientError, match="start 'Nope', expected one of"):
            client.spawn("P3AT", start="Nope")
        assert not host.simulation.vehicles
        client.spawn("P3AT", start="ROBOTstart2")


def test_refused_spawn_of_a_client_with_a_robot_raises(empty_room: Scene) -> None:
    with Client(Blind(Host(empty_room))) as client:
        client.spawn("P3AT", pose=Pose2(1, 2))
        expected = r"^the robot is still a 'P3AT', expected 'Tank': .*no such class"
        with pytest.raises(ClientError, match=expected):
            client.spawn("Tank")
        assert isinstance(client.wait_for(reports.GroundTruth), reports.GroundTruth)
        client.spawn("USARBot.P2AT", pose=Pose2(1, 2))
        assert client.robot_info().name == "P2AT"


def test_calls_on_a_closed_client_raise_an_error(empty_room: Scene) -> None:
    client = Client(InProcessTransport(Host(empty_room)))
    client.spawn("P3AT")
    client.close()
    client.close()
    assert client.read()  # reports that had arrived
    with pytest.raises(ClientError, match=r"^the connection is closed while .* report"):
        client.read()
    assert not client.stop()
