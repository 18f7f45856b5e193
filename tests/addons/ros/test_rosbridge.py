"""The robots of a server as topics of ROS 2, over rosbridge."""

import base64
import json
import math
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import run_in_process
from live_bridge import bridge, serving
from node_packages import install_packages
from odometry import integral_of, place_of, stamp_of
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from radarsim.addons.recording.messages import ECHO
from radarsim.addons.ros.board import Board
from radarsim.addons.ros.rosbridge import RosbridgeClient
from radarsim.addons.testing import UsarsimServer
from radarsim.client import Client
from radarsim.protocol.reports import RangeScan

TIMEOUT = 240  # s that a busy machine may need
SUPPORT = Path(__file__).parents[2] / "support"
DRIVER = SUPPORT / "rosbridge_drive.py"
foliage_server = pytest.mark.usarsim(map="foliage_room")


class Side:
    """A client of rosbridge."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection

    def send(self, **message: Any) -> None:
        self._connection.send(json.dumps(message))

    def wait_for(self, **fields: Any) -> Any:
        """Return the next message that has such fields."""
        while True:
            message = json.loads(self._connection.recv(TIMEOUT))
            if fields.items() <= message.items():
                return message

    def topics(self) -> dict[str, str]:
        self.send(op="call_service", service="/rosapi/topics", id="1")
        values = self.wait_for(op="service_response", id="1")["values"]
        return dict(zip(values["topics"], values["types"], strict=True))

    def wait_for_topic(self, name: str) -> dict[str, str]:
        deadline = time.monotonic() + TIMEOUT
        while name not in (topics := self.topics()):
            assert time.monotonic() < deadline
            time.sleep(0.1)
        return topics


@foliage_server
def test_robots_of_others_are_topics(usarsim_server: UsarsimServer) -> None:
    with (
        serving(Board(RosbridgeClient), usarsim_server, echoes=True, map="R2") as port,
        Client.connect("127.0.0.1", usarsim_server.port) as driver,
        connect(f"ws://127.0.0.1:{port}") as connection,
    ):
        driver.spawn("P3AT_Compare", name="R2", start="RobotStart1")
        side = Side(connection)
        side.wait_for_topic("/R2/lms200/echoes")
        topics = side.wait_for_topic("/tf")  # once it is known how the robot moves
        assert topics["/R2/Hokuyo/scan"] == "sensor_msgs/msg/LaserScan"
        assert {"/tf_static", "/clock", "/R2/odom"} <= topics.keys()
        side.send(op="subscribe", topic="/R2/Hokuyo/scan")
        found = side.wait_for(op="publish", topic="/R2/Hokuyo/scan")["msg"]
        assert found["header"]["frame_id"] == "R2/Hokuyo"
        stamp = found["header"]["stamp"]
        taken = stamp["sec"] + stamp["nanosec"] / 1e9
        while True:
            scan = driver.wait_for(RangeScan, name="Hokuyo", timeout=TIMEOUT)
            if scan.time >= taken - 1e-6:
                break
        assert scan.time == pytest.approx(taken)
        expected = [r if r < found["range_max"] else None for r in scan.ranges.tolist()]
        assert None in expected
        assert found["ranges"] == [
            r if r is None else pytest.approx(r, rel=1e-6) for r in expected
        ]
        side.send(op="subscribe", topic="/R2/lms200/echoes")
        cloud = side.wait_for(op="publish", topic="/R2/lms200/echoes")["msg"]
        points = np.frombuffer(base64.b64decode(cloud["data"]), ECHO)
        assert len(points) == cloud["width"] > 100
        side.send(op="subscribe", topic="/tf_static")  # latched
        frames = side.wait_for(op="publish", topic="/tf_static")["msg"]["transforms"]
        children = {frame["child_frame_id"] for frame in frames}
        assert {"R2/lms200", "R2/Hokuyo"} <= children
        assert side.wait_for_topic("/map")["/map"] == "nav_msgs/msg/OccupancyGrid"
        side.send(op="subscribe", topic="/map")
        map_ = side.wait_for(op="publish", topic="/map")["msg"]
        assert len(map_["data"]) == map_["info"]["width"] * map_["info"]["height"]
        assert {-1, 0, 100} == set(map_["data"])


@pytest.mark.slow
@pytest.mark.usarsim(map="empty_room", speed=5)
def test_twist_of_a_robot_at_its_free_start_adds_up_to_its_pose(
    usarsim_server: UsarsimServer,
) -> None:
    with (
        bridge(usarsim_server, "--web", "0", "--robot", "P3AT") as line,
        connect(f"ws://127.0.0.1:{line.rpartition(':')[2].strip()}") as connection,
    ):
        side = Side(connection)
        for topic in ("/R1/odom", "/R1/ground_truth", "/clock"):
            side.wait_for_topic(topic)
            side.send(op="subscribe", topic=topic)
        truth = side.wait_for(topic="/R1/ground_truth")["msg"]["pose"]["position"]
        # The first start of the map, as none was wanted.
        assert (truth["x"], truth["y"]) == pytest.approx((-8.0, 0.0), abs=1e-3)
        circle = {"linear": {"x": 0.6}, "angular": {"z": 0.5}}
        odometry: list[Any] = []
        times: list[float] = []
        while len(odometry) < 190:
            message = json.loads(connection.recv(TIMEOUT))
            if message["topic"] == "/clock":
                now = message["msg"]["clock"]
                times.append(now["sec"] + now["nanosec"] / 1e9)
            elif message["topic"] == "/R1/odom":
                odometry.append(message["msg"])
                side.send(op="publish", topic="/R1/cmd_vel", msg=circle)
    at, heading, way = integral_of(odometry)
    assert way > 10
    end, turned = place_of(odometry[-1])
    assert np.linalg.norm(end - at) < 0.02 * way
    assert math.remainder(turned - heading, 2 * math.pi) == pytest.approx(0, abs=0.02)
    # Who reads too slowly loses some.
    assert np.median(np.diff(times)) == pytest.approx(0.01)
    assert times[0] <= stamp_of(odometry[-1]) <= times[-1]


@foliage_server
def test_roslib_asks_for_topics_and_types(
    usarsim_server: UsarsimServer, tmp_path: Path
) -> None:
    install_packages(tmp_path, "roslib@2.1")
    program = SUPPORT / "roslib_questions.mjs"
    with serving(Board(RosbridgeClient), usarsim_server, robot_class="P3AT") as port:
        with connect(f"ws://127.0.0.1:{port}") as connection:
            Side(connection).wait_for_topic("/R1/odom")
        command = ["node", str(program), str(tmp_path), str(port)]
        data = json.loads(subprocess.check_output(command, timeout=TIMEOUT))
    types = dict(zip(data["topics"]["topics"], data["topics"]["types"], strict=True))
    assert types["/R1/odom"] == "nav_msgs/msg/Odometry"
    assert types["/R1/cmd_vel"] == "geometry_msgs/msg/Twist"
    assert (data["nodes"], data["params"]) == (["/radarsim"], [])
    assert data["scanners"] == ["/R1/lms200/scan"]
    assert data["raw"]["topics"] == data["topics"]["topics"]
    assert all(data["raw"]["typedefs_full_text"])
    assert data["odometry"]["header"]["stamp"] == {"sec": "int32", "nanosec": "uint32"}
    assert data["odometry"]["twist"]["covariance"] == ["float64"]
    assert data["unknown"] == []
    assert data["time"]["time"]["sec"] + data["time"]["time"]["nanosec"] > 0
    assert data["time"]["time"]["secs"] == data["time"]["time"]["sec"]
    assert data["beams"] == 181


def test_help_names_only_programs_that_connect() -> None:
    text = run_in_process("ros", "--help-all").text
    assert "roslib" in text.replace("roslibpy", "")
    assert "roslibpy" in text
    # By rosbridge it would want messages in CBOR: it has a protocol of its own here.
    assert "protocol of Foxglove" in " ".join(text.split())


def test_wrong_messages_are_answered() -> None:
    client = RosbridgeClient(Board(RosbridgeClient))
    wrong = [
        *("{", "[]", "7", '{"op": "no_such"}', '{"op": "subscribe"}', "[" * 60_000),
        '{"op": "subscribe", "topic": "/a", "throttle_rate": "x"}',
        f'{{"op": "subscribe", "topic": "/a", "throttle_rate": {10**400}}}',
        '{"op": "publish", "topic": "/R1/cmd_vel", "msg": {"linear": 3}}',
    ]
    for text in wrong:
        client.receive(text)
        answer = json.loads(client.waiting.popleft())
        assert (answer["op"], answer["level"]) == ("status", "error")
    assert "--robot" in answer["msg"]
    client.receive('{"op": "call_service", "service": "/no_such", "id": "a"}')
    answer = json.loads(client.waiting.popleft())
    assert (answer["id"], answer["result"]) == ("a", False)
    client.receive('{"op": "advertise", "topic": "/a", "type": "b"}')
    assert not client.waiting


def test_definitions_of_types_have_those_within() -> None:
    client = RosbridgeClient(Board(RosbridgeClient))
    wanted = {"type": "nav_msgs/Odometry"}
    call = {"op": "call_service", "service": "/rosapi/message_details"}
    client.receive(json.dumps({**call, "args": wanted}))
    (answer,) = map(json.loads, client.waiting)
    found = {each["type"]: each for each in answer["values"]["typedefs"]}
    assert next(iter(found)) == "nav_msgs/msg/Odometry"
    assert "geometry_msgs/msg/Point" in found
    pose = found["geometry_msgs/msg/PoseWithCovariance"]
    assert pose["fieldtypes"] == ["geometry_msgs/msg/Pose", "float64"]
    assert pose["fieldarraylen"] == [-1, 36]


def test_definitions_of_types_need_rosbags(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    client = RosbridgeClient(Board(RosbridgeClient))
    client.receive('{"op": "call_service", "service": "/rosapi/message_details"}')
    answer = json.loads(client.waiting.popleft())
    assert not answer["result"]
    assert "'.[record]'" in answer["values"]


@pytest.mark.parametrize(
    "message",
    [None, 3, {"linear": 3}, {"linear": {"x": "a"}}, {"linear": {"x": 10**400}}],
)
def test_wrong_velocities_do_not_drive(message: object) -> None:
    board, driven = Board(RosbridgeClient), list[tuple[float, float]]()
    board.drivers["/R1/cmd_vel"] = lambda *speeds: driven.append(speeds)
    client = RosbridgeClient(board)
    for msg in (message, {"twist": {"linear": {"x": 0.5}, "angular": {"z": -1}}}):
        text = {"op": "publish", "topic": "/R1/cmd_vel", "msg": msg}
        client.receive(json.dumps(text))
    assert driven == [(0.5, -1.0)]


def test_slow_client_loses_the_oldest_messages() -> None:
    client = RosbridgeClient(Board(RosbridgeClient))
    client.receive('{"op": "subscribe", "topic": "/a"}')
    for number in range(100):
        client.offer("/a", str(number), now=number / 10)
    waiting = [json.loads(text)["msg"] for text in client.waiting]
    assert len(waiting) < 100
    assert waiting == list(range(100))[-len(waiting) :]


def test_throttled_topic_comes_as_often_as_wanted() -> None:
    client = RosbridgeClient(Board(RosbridgeClient))
    client.receive('{"op": "subscribe", "topic": "/a", "throttle_rate": 500}')
    for number in range(21):
        client.offer("/a", "0", now=float(number) / 8)
    assert len(client.waiting) == 6


def offered(client: RosbridgeClient, seconds: float, start: float) -> int:
    """Return how many of ten messages a second of /a are queued."""
    client.waiting.clear()
    for number in range(round(10 * seconds)):
        if client.wants("/a"):
            client.offer("/a", "0", now=start + number / 10)
    return len(client.waiting)


def test_subscriptions_of_a_topic_end_by_their_ids() -> None:
    client = RosbridgeClient(Board(RosbridgeClient))
    client.receive('{"op": "subscribe", "topic": "/a", "id": "1"}')
    slow = '{"op": "subscribe", "topic": "/a", "id": "2", "throttle_rate": 1000}'
    client.receive(slow)
    assert offered(client, 2, 0.0) == 20  # the lowest rate counts
    client.receive('{"op": "unsubscribe", "topic": "/a", "id": "1"}')
    assert offered(client, 2, 10.0) == 2
    client.receive('{"op": "unsubscribe", "topic": "/a", "id": "3"}')
    assert client.wants("/a")
    client.receive('{"op": "unsubscribe", "topic": "/a", "id": "2"}')
    assert not client.wants("/a")
    client.receive('{"op": "unsubscribe", "topic": "/a", "id": "2"}')
    client.receive(slow)
    client.receive('{"op": "subscribe", "topic": "/a"}')
    client.receive('{"op": "unsubscribe", "topic": "/a"}')  # without an id: all
    assert not client.wants("/a")
    client.waiting.clear()
    client.receive(json.dumps({"op": "subscribe", "topic": "/a", "id": "x" * 1000}))
    assert "id of 1002 characters" in client.waiting[0]


def test_pages_of_other_sites_are_refused() -> None:
    with serving(Board(RosbridgeClient), origins=["http://friend.example"]) as port:
        address = f"ws://127.0.0.1:{port}"
        with (
            pytest.raises(InvalidStatus),
            connect(address, origin=Origin("http://evil.example")),
        ):
            pass
        with (
            pytest.raises(InvalidStatus),
            connect(address, additional_headers={"Host": "evil.example"}),
        ):
            pass
        with connect(address, origin=Origin("http://friend.example")) as connection:
            assert isinstance(Side(connection).topics(), dict)


@foliage_server
@pytest.mark.parametrize("seconds", [2.0, pytest.param(10.0, marks=pytest.mark.slow)])
def test_roslibpy_hears_scans_and_drives(
    seconds: float, usarsim_server: UsarsimServer
) -> None:
    pytest.importorskip("roslibpy")
    robot = ("--robot", "P3AT", "--start", "RobotStart1")
    with bridge(usarsim_server, "--web", "0", *robot) as line:
        port = line.rpartition(":")[2].strip()
        with connect(f"ws://127.0.0.1:{port}") as connection:
            Side(connection).wait_for_topic("/R1/cmd_vel")
        command = [sys.executable, str(DRIVER), port, str(seconds)]
        data = json.loads(subprocess.check_output(command, timeout=TIMEOUT))
    assert {"/R1/lms200/scan", "/R1/cmd_vel", "/tf"} <= set(data["topics"])
    assert data["time"] > 0
    stamps = [scan["header"]["stamp"] for scan in data["scans"]]
    times = np.array([stamp["sec"] + stamp["nanosec"] / 1e9 for stamp in stamps])
    assert times[-1] - times[0] >= seconds
    np.testing.assert_allclose(np.diff(times), 0.1, atol=0.021)
    x = [pose["pose"]["position"]["x"] for pose in data["poses"]]
    assert x[0] + 0.5 <= x[-1] < x[0] + 3.5
    assert x[-1] == x[-2]  # it stands, as no command comes any more
