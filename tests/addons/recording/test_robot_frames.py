"""Odometry and frames are those of REP-105: what a subscriber computes is the truth."""

import json
import math
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from odometry import integral_of, place_of, stamp_of

from radarsim.addons.recording.bag import BagReader
from radarsim.addons.recording.bag_folder import RecordingInfo
from radarsim.addons.recording.call_converter import CallConverter
from radarsim.addons.recording.messages import TopicMessage
from radarsim.addons.recording.recorders import HostRecorder, RunEvent
from radarsim.addons.recording.run_recording import RecordOptions
from radarsim.addons.ros.rosbridge import message_json
from radarsim.cli.server_options import ServedMap, ServerOptions
from radarsim.client.session import Session
from radarsim.geometry import Floats, Pose3
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.protocol.reports import GroundTruth
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

INIT = b"INIT {ClassName P3AT} {Name R1} {Location -2,1,0} {Rotation 0,0,-0.5}\r\n"
CIRCLE = b"DRIVE {Left 3.5} {Right 4.5}\r\n"
RESET = b"SET {Type Odometry} {Opcode RESET}\r\n"
DIALECTS = pytest.mark.parametrize(
    "dialect", [COMPAT, UDK], ids=lambda dialect: dialect.name
)


class Run:
    """What a robot was sent in a run, and the topics that it becomes.

    Attributes:
        truths: The true poses by time stamps.
        topics: Fields of the messages of each topic.
    """

    def __init__(
        self,
        scene: Scene,
        *commands: bytes,
        dialect: Dialect = COMPAT,
        own_localization: bool = False,
        ticks: int = 1000,
    ) -> None:
        """Send commands to a host, each so many ticks before the next."""
        events: list[RunEvent] = []
        host = Host(
            scene,
            config=SimulationConfig(dialect),
            observers=[HostRecorder(events.append)],
        )
        client, session = host.connect(), Session()
        self.truths: dict[float, Pose3] = {}
        for command in commands:
            host.receive(client, command)
            for _ in range(ticks):
                host.step()
                for report in session.receive(host.take(client)):
                    if isinstance(report, GroundTruth):
                        self.truths[round(report.time, 2)] = report.pose
        config = SimulationConfig(dialect)
        info = RecordingInfo.of_config(config, own_localization=own_localization)
        converter = CallConverter(info)
        self.topics: defaultdict[str, list[Any]] = defaultdict(list)
        for event in events:
            for _, message in converter.convert(event):
                self._add(message)

    def _add(self, message: TopicMessage) -> None:
        self.topics[message.topic].append(json.loads(message_json(message)))

    def frames(self, parent: str, child: str) -> dict[float, Floats]:
        """Return matrices of a transform by their time stamps."""
        return {
            stamp_of(each): matrix_of(**each["transform"])
            for message in self.topics["/tf"]
            for each in message["transforms"]
            if (each["header"]["frame_id"], each["child_frame_id"]) == (parent, child)
        }


def matrix_of(translation: Any, rotation: Any) -> Floats:
    """Return the matrix, (4, 4), of a transform, from its unit quaternion."""
    x, y, z, w = (rotation[axis] for axis in "xyzw")
    matrix = np.eye(4)
    vector = np.array([x, y, z])
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix[:3, :3] = (w * w - vector @ vector) * np.eye(3)
    matrix[:3, :3] += 2 * (np.outer(vector, vector) + w * cross)
    matrix[:3, 3] = [translation[axis] for axis in "xyz"]
    return matrix


def test_integrated_twist_is_the_pose(empty_room: Scene) -> None:
    odometry = Run(empty_room, INIT + CIRCLE, ticks=3000).topics["/R1/odom"]
    at, heading, way = integral_of(odometry)
    assert way > 10
    end, turned = place_of(odometry[-1])
    assert np.linalg.norm(end - at) < 0.02 * way
    assert math.remainder(turned - heading, 2 * math.pi) == pytest.approx(0, abs=0.02)


@DIALECTS
def test_frames_lead_to_the_true_pose(empty_room: Scene, dialect: Dialect) -> None:
    drive = CIRCLE if dialect is COMPAT else b"DRIVE {Left 0.5} {Right 0.6}\r\n"
    run = Run(empty_room, INIT + drive, dialect=dialect)
    odom = run.frames("map", "R1/odom")
    base = run.frames("R1/odom", "R1/base_link")
    assert odom.keys() == base.keys()
    assert len(base) > 40
    for time, matrix in odom.items():
        pose = run.truths[time]
        found = matrix @ base[time]
        # To the digits on the wire.
        assert found[:3, 3] == pytest.approx(pose.position(), abs=2e-3)
        assert found[:3, :3] == pytest.approx(pose.rotation(), abs=2e-3)


def test_odometry_moves_without_jumps_but_for_a_reset(empty_room: Scene) -> None:
    run = Run(empty_room, INIT + CIRCLE, RESET)
    odometry = run.topics["/R1/odom"]
    steps = np.diff([place_of(message)[0] for message in odometry], axis=0)
    assert (np.hypot(*steps.T) > 0.1).sum() == 1
    speeds = [message["twist"]["twist"]["linear"]["x"] for message in odometry]
    assert 0.0 <= min(speeds) < 0.3 < max(speeds) < 0.8


@DIALECTS
def test_own_localization_leaves_out_the_correction_alone(
    empty_room: Scene, dialect: Dialect
) -> None:
    run = Run(empty_room, INIT, dialect=dialect, own_localization=True)
    assert not run.frames("map", "R1/odom")
    assert len(run.frames("R1/odom", "R1/base_link")) > 40


def test_ins_reports_the_pose_of_the_robot(empty_room: Scene) -> None:
    run = Run(empty_room, INIT)
    for message in run.topics["/R1/ins"]:
        assert message["header"]["frame_id"] == "map"
        pose = run.truths[stamp_of(message)]
        found = [message["pose"]["position"][axis] for axis in "xyz"]
        assert found == pytest.approx(pose.position(), abs=1e-3)


@pytest.mark.slow
def test_own_localization_is_an_option_of_recordings(
    empty_room: Scene, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    options = RecordOptions(record=folder, record_own_localization=True)
    extension = options.extension(ServedMap("empty_room", ServerOptions(), 0))
    assert extension is not None
    extension.open()
    extension.attach(Host(empty_room))
    extension.close()
    assert BagReader(folder).info.own_localization
