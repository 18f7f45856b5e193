"""Program: drive a robot over DDS, and print what it heard as JSON.

Arguments: the domain, and how many scans to hear. It ends before if its standard input
does. Its types are written by hand, from the definitions of ROS.
"""

import json
import math
import select
import sys
from dataclasses import dataclass
from typing import Any

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float32, float64, int32, sequence, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

POLL = 0.05  # s between looks for scans
LOCAL = """<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo"/>
</Interfaces><AllowMulticast>false</AllowMulticast></General><Discovery>
<ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers>
</Discovery></Domain></CycloneDDS>"""


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class LaserScan(IdlStruct, typename="sensor_msgs::msg::dds_::LaserScan_"):
    header: Header
    angle_min: float32
    angle_max: float32
    angle_increment: float32
    time_increment: float32
    scan_time: float32
    range_min: float32
    range_max: float32
    ranges: sequence[float32]  # type: ignore[type-arg]
    intensities: sequence[float32]  # type: ignore[type-arg]


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Twist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    linear: Vector3
    angular: Vector3


def main() -> None:
    domain, count = int(sys.argv[1]), int(sys.argv[2])
    kept = Domain(domain, LOCAL)
    participant = DomainParticipant(domain)
    quality = Qos(Policy.Reliability.Reliable(0), Policy.History.KeepLast(10))
    scans = Topic(participant, "rt/R1/lms200/scan", LaserScan)
    reader = DataReader(participant, scans, quality)
    wheels = Topic(participant, "rt/R1/cmd_vel", Twist)
    writer = DataWriter(participant, wheels, quality)
    heard: list[dict[str, Any]] = []
    while len(heard) < count and not select.select([sys.stdin], [], [], POLL)[0]:
        if len(heard) < count / 2:
            writer.write(Twist(Vector3(0.3, 0.0, 0.0), Vector3(0.0, 0.0, 0.0)))
        for scan in reader.take(10):
            stamp = scan.header.stamp
            ranges: Any = scan.ranges
            heard.append(
                {
                    "time": stamp.sec + stamp.nanosec / 1e9,
                    "frame": scan.header.frame_id,
                    "ranges": [r if math.isfinite(r) else None for r in ranges],
                }
            )
    sys.stdout.write(json.dumps(heard))
    del kept


if __name__ == "__main__":
    main()
