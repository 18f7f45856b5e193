"""Topics for Foxglove, in its protocol, and who may connect."""

import json
import struct
import subprocess
import time
from pathlib import Path
from typing import Any

import foxglove
import numpy as np
import pytest
from foxglove.websocket import Capability
from live_bridge import bridge, serving
from node_packages import install_packages
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

from radarsim.addons.recording import messages
from radarsim.addons.recording.cdr import encode, typestore
from radarsim.addons.recording.messages import Fields, TopicMessage
from radarsim.addons.ros.board import Board
from radarsim.addons.ros.foxglove import FoxgloveClient
from radarsim.addons.testing import UsarsimServer
from radarsim.geometry import Pose3

TIMEOUT = 240  # s that a busy machine may need
SUPPORT = Path(__file__).parents[2] / "support"
SDK = Subprotocol("foxglove.sdk.v1")
POSE = messages.pose_stamped("/a", 1.5, "map", Pose3(1.0, 2.0, 3.0))
foliage_server = pytest.mark.usarsim(map="foliage_room")
PACKAGES = (
    *("@foxglove/ws-protocol@0.8.0", "@foxglove/rosmsg@5.0.5"),
    *("@foxglove/rosmsg2-serialization@3.1.0", "ws@8.23.0"),
)


def subscribed(topic: str = "/a") -> tuple[Board, FoxgloveClient]:
    """Return a board with a topic, and a client that has subscribed to it as 7."""
    board = Board(FoxgloveClient)
    board.add(POSE._replace(topic=topic), wanted=False)
    client = FoxgloveClient(board)
    client.receive(subscription(7, 1))
    client.waiting.clear()
    return board, client


def subscription(number: int, channel: int) -> str:
    each = {"id": number, "channelId": channel}
    return json.dumps({"op": "subscribe", "subscriptions": [each]})


def statuses(client: FoxgloveClient) -> list[str]:
    texts = [json.loads(each) for each in client.waiting if isinstance(each, str)]
    assert all(each["level"] == 2 for each in texts if each["op"] == "status")
    return [each["message"] for each in texts if each["op"] == "status"]


def test_protocol_is_that_of_foxgloves_sdk() -> None:
    definition, _ = typestore().generate_msgdef(POSE.type, ros_version=2)
    context = foxglove.Context()
    server = foxglove.start_server(
        name="radarsim",
        port=0,
        context=context,
        capabilities=[Capability.ClientPublish, Capability.Time],
        supported_encodings=["cdr", "json"],
    )
    schema = foxglove.Schema(
        name=POSE.type, encoding="ros2msg", data=definition.encode()
    )
    channel = foxglove.Channel(
        "/a", schema=schema, message_encoding="cdr", context=context
    )
    try:
        with connect(f"ws://127.0.0.1:{server.port}", subprotocols=[SDK]) as peer:
            info, data = (json.loads(peer.recv(TIMEOUT)) for _ in range(2))
            peer.send(subscription(7, data["channels"][0]["id"]))
            while not channel.has_sinks():
                time.sleep(0.01)
            channel.log(encode(POSE), log_time=1_500_000_000)
            expected = peer.recv(TIMEOUT)
            server.broadcast_time(1_500_000_000)
            expected_time = peer.recv(TIMEOUT)
    finally:
        server.stop()
    board, client = subscribed()
    first, second = (json.loads(each) for each in FoxgloveClient(board).waiting)
    kept = ("op", "name", "capabilities", "supportedEncodings")
    assert {key: first[key] for key in kept} == {key: info[key] for key in kept}
    for each in data["channels"]:
        each["id"] = 1  # the sdk numbers all channels of a process
    assert second == data
    board.add(messages.clock(1.5), wanted=False)
    client.offer("/a", board.add(POSE, wanted=True), 0.0)
    client.offer("/clock", b"", 0.0)
    assert list(client.waiting) == [expected, expected_time]


def test_new_topics_and_latched_messages_are_reported() -> None:
    board, client = subscribed()
    for last in ("first", "last"):
        board.add(messages.string("/b", last), wanted=False)
    client.announce("/b")
    (channel,) = json.loads(client.waiting.popleft())["channels"]
    assert (channel["id"], channel["topic"]) == (2, "/b")
    client.receive(subscription(8, 2))
    (data,) = client.waiting
    assert struct.unpack("<BIQ", data[:13]) == (1, 8, 0)
    text = typestore().deserialize_cdr(data[13:], "std_msgs/msg/String")
    assert text.data == "last"  # type: ignore[attr-defined]


def test_nothing_comes_after_an_unsubscription() -> None:
    _, client = subscribed()
    assert client.wants("/a")
    client.receive('{"op": "unsubscribe", "subscriptionIds": [7, 9]}')
    assert not client.wants("/a")


def test_slow_client_loses_the_oldest_messages_and_no_news() -> None:
    _, client = subscribed()
    client.announce("/a")
    for number in range(100):
        client.offer("/a", struct.pack("<I", number), 0.0)
    news, *rest = client.waiting
    assert json.loads(news)["op"] == "advertise"
    numbers = [struct.unpack("<I", each[13:])[0] for each in rest]
    assert len(numbers) < 100
    assert numbers == list(range(100))[-len(numbers) :]


def test_wrong_messages_are_answered() -> None:
    board, client = subscribed()
    board.drivers["/R1/cmd_vel"] = lambda *_: pytest.fail("it drives")
    client.receive(advertisement(1, "/R1/cmd_vel", "cdr"))
    client.receive(advertisement(2, "/goal_pose", "cdr"))
    assert not client.waiting  # panels announce what they may publish
    wrong: list[str | bytes] = [
        *("{", "[]", "7", '{"op": "no_such"}', '{"op": "subscribe"}', "[" * 60_000),
        *(subscription(1, 2), subscription(1, -1), b"", b"\x07", b"\x01\x01\0\0\0ab"),
        '{"op": "subscribe", "subscriptions": [{"id": 1e400, "channelId": 1}]}',
        '{"op": "subscribe", "subscriptions": 3}',
        subscription(2**40, 1),
        *(struct.pack("<BI", 1, 9), struct.pack("<BI", 1, 2) + b"abc"),
    ]
    for data in wrong:
        client.waiting.clear()
        client.receive(data)
        assert len(statuses(client)) == 1, data
    assert "/R1/cmd_vel" in statuses(client)[0]


def advertisement(
    number: int, topic: str, encoding: str, type_: str = "geometry_msgs/msg/Twist"
) -> str:
    each = {"id": number, "topic": topic, "encoding": encoding, "schemaName": type_}
    return json.dumps({"op": "advertise", "channels": [each]})


def velocity(speed: float, turn: float) -> Fields:
    linear, angular = messages.vector(speed, 0, 0), messages.vector(0, 0, turn)
    return Fields(linear=linear, angular=angular)


def test_clients_drive_in_both_encodings_by_types_of_velocities() -> None:
    board, driven = Board(FoxgloveClient), list[tuple[float, float]]()
    board.drivers["/cmd_vel"] = lambda *speeds: driven.append(speeds)
    client = FoxgloveClient(board)
    header = Fields(stamp=Fields(sec=5, nanosec=7), frame_id="base_link")
    fields = Fields(header=header, twist=velocity(0.75, 1.0))
    stamped = TopicMessage("/b", "geometry_msgs/msg/TwistStamped", fields)
    text = b'{"linear": {"x": 0.25}, "angular": {"z": 2}}'
    plain = encode(TopicMessage("/b", "geometry_msgs/msg/Twist", velocity(0.5, -1.0)))
    for number, encoding, type_, data in (
        (3, "cdr", "geometry_msgs/msg/Twist", plain),
        (4, "json", "geometry_msgs/msg/Twist", text),
        (5, "cdr", stamped.type, encode(stamped)),
    ):
        client.receive(advertisement(number, "/cmd_vel", encoding, type_))
        client.receive(struct.pack("<BI", 1, number) + data)
    assert driven == [(0.5, -1.0), (0.25, 2.0), (0.75, 1.0)]
    client.receive(advertisement(6, "/cmd_vel", "cdr", "std_msgs/msg/String"))
    client.receive('{"op": "unadvertise", "channelIds": [3]}')
    client.waiting.clear()
    client.receive(struct.pack("<BI", 1, 3) + plain)
    client.receive(struct.pack("<BI", 1, 6) + plain)
    assert len(driven) == 3
    _, wrong_type = statuses(client)
    assert "std_msgs/msg/String" in wrong_type


def test_entries_of_a_client_are_limited() -> None:
    board, client = subscribed()
    for number in range(1200):
        client.receive(subscription(number, 1))
        client.receive(advertisement(number, "/a", "cdr"))
    assert len(statuses(client)) > 300
    assert board.types.keys() == {"/a"}


@pytest.mark.parametrize(
    ("origin", "trusted"),
    [
        ("https://app.foxglove.dev", True),
        *(("file://", True), ("foxglove://app", True)),  # programs on a desktop
        *(("https://evil.example", False), ("http://app.foxglove.dev", False)),
        *(("null", False), ("", False), ("https://app.foxglove.dev.evil.de", False)),
    ],
)
def test_only_foxglove_is_trusted(origin: str, trusted: bool) -> None:
    assert FoxgloveClient.trusts(origin) is trusted


def await_topics(peer: ClientConnection, *wanted: str) -> dict[str, Any]:
    """Return channels by topic as soon as those that are wanted are there."""
    found: dict[str, Any] = {}
    while not found.keys() >= set(wanted):
        data = peer.recv(TIMEOUT)
        if isinstance(data, str) and json.loads(data)["op"] == "advertise":
            found |= {each["topic"]: each for each in json.loads(data)["channels"]}
    return found


@foliage_server
def test_foxglove_sees_the_world_and_pages_of_others_do_not(
    usarsim_server: UsarsimServer,
) -> None:
    shown = {"draw": "foliage_room", "true_map": True, "no_namespace": "R1"}
    with serving(
        Board(FoxgloveClient), usarsim_server, robot_class="P3AT", **shown
    ) as port:
        address = f"ws://127.0.0.1:{port}"
        with (
            pytest.raises(InvalidStatus),
            connect(address, subprotocols=[SDK], origin=Origin("http://evil.example")),
        ):
            pass
        app = Origin("https://app.foxglove.dev")
        with connect(address, subprotocols=[SDK], origin=app, max_size=None) as peer:
            assert peer.subprotocol == SDK
            topics = ("/scene", "/map", "/robot_description", "/tf", "/lms200/scan")
            found = await_topics(peer, *topics)
            for topic in topics:
                channel = found[topic]["id"]
                peer.send(subscription(channel, channel))
            heard: dict[str, Any] = {}
            while not heard.keys() >= set(topics):
                data = peer.recv(TIMEOUT)
                if isinstance(data, bytes) and data[0] == 1:
                    _, number, _ = struct.unpack("<BIQ", data[:13])
                    topic = next(t for t in topics if found[t]["id"] == number)
                    type_ = found[topic]["schemaName"]
                    heard[topic] = typestore().deserialize_cdr(data[13:], type_)
    assert len(heard["/scene"].markers) == 16
    cells = heard["/map"].data.reshape(heard["/map"].info.height, -1)
    assert {*np.unique(cells)} == {0, 100}
    assert 'link name="base_link"' in heard["/robot_description"].data
    assert heard["/lms200/scan"].header.frame_id == "lms200"


@pytest.mark.slow
@foliage_server
def test_foxgloves_own_client_reads_every_topic_and_drives(
    usarsim_server: UsarsimServer, tmp_path: Path
) -> None:
    install_packages(tmp_path, *PACKAGES)
    wanted = ["/scene", "/map", "/R1/robot_description", "/R1/odom", "/tf"]
    wanted += ["/tf_static", "/R1/lms200/scan", "/R1/lms200/echoes", "/clock"]
    options = ["--bridge", "foxglove", "--web", "0", "--robot", "P3AT", "--echoes"]
    options += ["--draw", "foliage_room", "--true-map"]
    with bridge(usarsim_server, *options) as line:
        assert "Foxglove on ws://127.0.0.1:" in line
        port = line.rpartition(":")[2].strip()
        program = SUPPORT / "foxglove_questions.mjs"
        words = ["node", str(program), str(tmp_path), port, "/R1/cmd_vel"]
        heard = json.loads(subprocess.check_output([*words, *wanted], timeout=TIMEOUT))
        with connect(f"ws://127.0.0.1:{port}", subprotocols=[SDK]) as peer:
            channel = await_topics(peer, "/R1/odom")["/R1/odom"]["id"]
            peer.send(subscription(1, channel))
            while (data := peer.recv(TIMEOUT))[:1] != b"\x01":
                pass
            assert isinstance(data, bytes)
            odometry: Any = typestore().deserialize_cdr(
                data[13:], "nav_msgs/msg/Odometry"
            )
    assert heard["status"] == []
    assert heard["info"]["name"] == "radarsim"
    assert heard["times"] == sorted(heard["times"])
    assert len(heard["messages"]["/scene"]["markers"]) == 16
    assert heard["messages"]["/map"]["info"]["resolution"] == pytest.approx(0.05)
    assert heard["messages"]["/R1/lms200/scan"]["ranges"] == 181
    stamp = heard["messages"]["/R1/odom"]["header"]["stamp"]
    sent_at = heard["stamps"]["/R1/odom"] / 1e9
    assert sent_at - stamp["sec"] - stamp["nanosec"] / 1e9 == pytest.approx(0, abs=0.05)
    assert odometry.pose.pose.position.x > 0.01
