"""Program: hear over DDS which frame has which parent, and print it as JSON.

Arguments: the domain, and ``map`` to publish meanwhile the transform from ``map`` to
``R1/odom``, as a program that localises the robot does. It prints pairs of parent and
child, and ends when it has heard of 50 poses of the robot. Its types are written by
hand, from the definitions of ROS.
"""

import json
import sys
import time
from dataclasses import dataclass
from typing import Any

from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import sequence
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from dds_drive import LATCHED, LOCAL, RELIABLE, Header, Quaternion, Time, Vector3

INTERVAL = 0.05  # s


@dataclass
class Transform(IdlStruct, typename="geometry_msgs::msg::dds_::Transform_"):
    translation: Vector3
    rotation: Quaternion


@dataclass
class TransformStamped(
    IdlStruct, typename="geometry_msgs::msg::dds_::TransformStamped_"
):
    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs::msg::dds_::TFMessage_"):
    transforms: sequence[TransformStamped]  # type: ignore[type-arg]


def main() -> None:
    domain, localises = int(sys.argv[1]), "map" in sys.argv
    kept = Domain(domain, LOCAL)
    participant = DomainParticipant(domain)
    moving = Topic(participant, "rt/tf", TFMessage)
    writer = DataWriter(participant, moving, RELIABLE)
    static = Topic(participant, "rt/tf_static", TFMessage)
    readers = [
        DataReader(participant, moving, RELIABLE),
        DataReader(participant, static, LATCHED),
    ]
    place = Transform(Vector3(0.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))
    own = TransformStamped(Header(Time(1, 0), "map"), "R1/odom", place)
    pairs: list[tuple[str, str]] = []
    while pairs.count(("R1/odom", "R1/base_link")) < 50:
        if localises:
            writer.write(TFMessage([own]))  # type: ignore[arg-type]
        time.sleep(INTERVAL)
        for reader in readers:
            for message in reader.take(100):
                stamped: Any = message.transforms
                pairs += [(e.header.frame_id, e.child_frame_id) for e in stamped]
    sys.stdout.write(json.dumps(sorted(set(pairs))))
    del kept


if __name__ == "__main__":
    main()
