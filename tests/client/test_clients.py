"""Both clients over TCP: the same calls give the same results and errors."""

import math
import re
import select
import socket
import struct
import time
from collections.abc import Callable
from contextlib import suppress

import numpy as np
import pytest

from radarsim.addons.testing import UsarsimServer
from radarsim.client import Client, ClientError, ClientTimeout
from radarsim.geometry import Pose2, Pose3
from radarsim.protocol import reports

from .conftest import DEADLINE, Serve

Connect = Callable[..., Client]
GREETING = b"NFO {Gametype X} {Level DM-Odd} {TimeLimit 0}\r\n"
STATUS = b"STA {Type GroundVehicle} {Time 1.00} {Battery 9}\r\n"


@pytest.mark.usarsim(speed=5)
def test_client_requests_robot_info_and_drives(
    usarsim_server: UsarsimServer, connect: Connect
) -> None:
    client = connect(usarsim_server.port)
    assert client.greeting() == reports.Greeting("DM-EmptyRoom")
    assert client.greeting() == reports.Greeting("DM-EmptyRoom")
    assert client.start_poses()["RobotStart2"] == Pose3(-8, 3.5, 0)
    client.spawn("P3AT", name="R1", pose=Pose2(-8, 1, math.pi / 2))
    assert isinstance(client.geometry("Robot"), reports.RobotGeo)
    assert isinstance(client.geometry("INS", "InsTest"), reports.ItemGeo)
    assert isinstance(client.configuration("GroundTruth"), reports.IntervalConf)
    info = client.robot_info()
    assert (info.name, info.length, info.width) == ("P3AT", 0.552, 0.497)
    assert info.clearance == pytest.approx(0.3714, abs=1e-4)
    assert info.top_speed == pytest.approx(0.8, abs=1e-3)
    scan = client.wait_for(reports.RangeScan, name="lms200")
    assert len(scan.ranges) == len(info.scanner().angles) == 181
    before = client.wait_for(reports.GroundTruth).pose
    assert (before.x, before.y) == pytest.approx((-8, 1), abs=1e-3)
    client.drive(*info.wheel_speeds(0.5, 0))
    while client.wait_for(reports.GroundTruth).pose.y < 1.2:
        pass
    assert client.stop()
    assert client.read()
    assert client.session.unread == 0
    assert client.session.time > 0


@pytest.mark.usarsim(speed=5, map="foliage_room")
def test_echoes_and_set_item_take_effect(
    usarsim_server: UsarsimServer, connect: Connect
) -> None:
    client = connect(usarsim_server.port)
    client.spawn("P3AT", start="RobotStart1")
    client.echoes("lms200")
    line = client.wait_for(reports.EchoLine)
    assert line.echoes is not None
    client.echoes("lms200", False)
    client.drive(5, 5)
    while client.wait_for(reports.Odometry).pose.x < 0.2:
        pass
    client.set_item("Odometry", None, "RESET")
    while client.wait_for(reports.Odometry).pose.x > 0.2:
        pass


@pytest.mark.usarsim(speed=5, dialect="udk")
def test_robot_info_is_complete_in_the_udk_dialect(
    usarsim_server: UsarsimServer, connect: Connect
) -> None:
    client = connect(usarsim_server.port)
    client.spawn("P3AT_Radar360", start="RobotStart1")
    info = client.robot_info(drive_unit="rev_per_s")
    assert info.top_speed == pytest.approx(0.8, abs=1e-3)
    assert info.clearance > 0.3714
    assert info.clearance < 0.45
    scanner = info.scanner("LMS200")
    assert scanner.mount == Pose3(0.21, 0, 0.2)
    assert scanner.max_range == 20
    assert np.allclose(np.degrees(scanner.angles), np.arange(360) - 179.5, atol=0.01)


def test_connection_error_names_the_address(connect: Connect) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with pytest.raises(ClientError, match=f"no server at 127.0.0.1:{port}; start one"):
        connect(port)


def test_timeout_must_be_above_0(connect: Connect, serve: Serve) -> None:
    with pytest.raises(ValueError, match="timeout 0, expected more than 0 s"):
        connect(serve(_be_silent), timeout=0)


def test_calls_time_out_when_the_server_is_silent(
    connect: Connect, serve: Serve
) -> None:
    client = connect(serve(_be_silent), timeout=0.3)
    expected = r"no greeting within 0\.3 s, no complete line was received"
    with pytest.raises(ClientTimeout, match=expected):
        client.greeting()
    with pytest.raises(ClientTimeout, match=r"no GEO of Robot within 0\.3 s"):
        client.robot_info()
    with pytest.raises(ClientTimeout, match=r"no RangeScan of 'a' within 0\.02 s"):
        client.wait_for(reports.RangeScan, name="a", timeout=0.02)
    with pytest.raises(ClientTimeout, match="no reading of the robot 'P3AT'"):
        client.spawn("P3AT")


def test_timeout_error_quotes_the_last_line(connect: Connect, serve: Serve) -> None:
    def half(peer: socket.socket) -> None:
        peer.sendall(GREETING + b"XYZ {A 1}\r\nSEN {Type INS} {Loc")
        _be_silent(peer)

    client = connect(serve(half))
    assert client.greeting().level == "DM-Odd"
    expected = "no report within .* the last line was 'XYZ {A 1}'; 1 lines could not"
    with pytest.raises(ClientTimeout, match=expected):
        client.read(0.1)


@pytest.mark.parametrize("abruptly", [False, True], ids=["closed", "reset"])
def test_lost_connection_raises_a_client_error(
    connect: Connect, serve: Serve, abruptly: bool
) -> None:
    def drop(peer: socket.socket) -> None:
        peer.sendall(STATUS)
        peer.recv(1)
        if abruptly:
            linger = struct.pack("ii", 1, 0)
            peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)

    client = connect(serve(drop))
    assert client.session.greeting is None
    expected = r"^the .*connection.* waited for the start poses, the last line was"
    with pytest.raises(ClientError, match=expected) as caught:
        client.start_poses()
    assert not isinstance(caught.value, ClientTimeout)
    with pytest.raises(ClientError, match=r"^the .*connection.* waited for the report"):
        client.read()
    with suppress(ClientError):
        client.drive(1, 1)  # the first may still go out
    client.close()
    client.close()


def test_endless_unknown_lines_do_not_prevent_the_timeout(
    connect: Connect, serve: Serve
) -> None:
    def rave(peer: socket.socket) -> None:
        while True:
            peer.sendall(b"SEN {Type Victim}\r\n" * 10)
            time.sleep(0.001)

    client = connect(serve(rave), timeout=0.5)
    began = time.monotonic()
    with pytest.raises(
        ClientTimeout, match=r"'SEN {Type Victim}'; .* could not be parsed"
    ):
        client.read()
    assert time.monotonic() - began < DEADLINE


def test_server_that_does_not_read_is_a_client_error(
    connect: Connect, serve: Serve
) -> None:
    client = connect(serve(_take_nothing), timeout=0.5)
    text = "x" * 60_000
    expected = r"^the server has stopped reading; the client could not send 'SET"
    with pytest.raises(ClientError, match=expected):
        _flood(client, text)
    assert not client.stop()


def test_close_stops_the_robot(connect: Connect, serve: Serve) -> None:
    heard = bytearray()

    def listen(peer: socket.socket) -> None:
        peer.sendall(GREETING + STATUS)
        while data := peer.recv(4096):
            heard.extend(data)

    port = serve(listen)
    client = connect(port)
    client.spawn("USARBot.P3AT", pose=Pose2(1.0, 2.0))
    client.drive(1, 2.5)
    client.close()
    expected = (
        b"INIT {ClassName USARBot.P3AT}"
        b" {Location 1.0,-2.0,0.0} {Rotation 0.0,0.0,0.0}\r\n"
        b"DRIVE {Left 1.0} {Right 2.5}\r\nDRIVE {Left 0.0} {Right 0.0}\r\n"
    )
    until = time.monotonic() + DEADLINE
    while bytes(heard) != expected and time.monotonic() < until:
        time.sleep(0.001)
    assert bytes(heard) == expected
    with pytest.raises(
        ClientError, match=r"^the connection is .*; the client could not send 'DRIV"
    ):
        client.drive(0, 0)
    assert not client.stop()


@pytest.mark.parametrize("text", ["a\r\nDRIVE {Left 1}", "}{"])
def test_robot_name_cannot_inject_a_command(
    connect: Connect, serve: Serve, text: str
) -> None:
    client = connect(serve(_be_silent), timeout=0.2)
    with pytest.raises(ValueError, match=re.escape(repr(text))):
        client.spawn("P3AT", name=text)
    with pytest.raises(ValueError, match="expected only one of them"):
        client.spawn("P3AT", start="A", pose=Pose2(0, 0))


def _be_silent(peer: socket.socket) -> None:
    while peer.recv(4096):
        pass


def _take_nothing(peer: socket.socket) -> None:
    poller = select.poll()
    poller.register(peer, 0)  # wakes when the connection is gone, and only then
    poller.poll(1000 * DEADLINE)


def _flood(client: Client, text: str) -> None:
    for _ in range(1000):
        client.set_item("A", None, "B", text)
