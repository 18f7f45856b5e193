"""Program: drive a robot over DDS, and print what it heard as JSON.

Arguments: the domain, and how many scans to hear; it waits for a map as well. It ends
before if its standard input does. Its types are written by hand, from the definitions
of ROS.
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
from cyclonedds.idl.types import float32, float64, int8, int32, sequence, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

POLL = 0.05  # s between looks for scans
LOCAL = """<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo"/>
</Interfaces><AllowMulticast>false</AllowMulticast></General><Discovery>
<ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers>
</Discovery></Domain></CycloneDDS>"""


RELIABLE = Qos(Policy.Reliability.Reliable(0), Policy.History.KeepLast(100))
LATCHED = Qos(
    Policy.Durability.TransientLocal, Policy.History.KeepLast(1), base=RELIABLE
)


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


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class MapMetaData(IdlStruct, typename="nav_msgs::msg::dds_::MapMetaData_"):
    map_load_time: Time
    resolution: float32
    width: uint32
    height: uint32
    origin: Pose


@dataclass
class OccupancyGrid(IdlStruct, typename="nav_msgs::msg::dds_::OccupancyGrid_"):
    header: Header
    info: MapMetaData
    data: sequence[int8]  # type: ignore[type-arg]


def as_json(grid: OccupancyGrid) -> dict[str, Any]:
    """Return a map as plain data."""
    info, corner = grid.info, grid.info.origin.position
    data: Any = grid.data
    return {
        "frame": grid.header.frame_id,
        "resolution": info.resolution,
        "shape": [info.height, info.width],
        "origin": [corner.x, corner.y],
        "data": list(data),
    }


def main() -> None:
    domain, count = int(sys.argv[1]), int(sys.argv[2])
    kept = Domain(domain, LOCAL)
    participant = DomainParticipant(domain)
    scans = Topic(participant, "rt/R1/lms200/scan", LaserScan)
    reader = DataReader(participant, scans, RELIABLE)
    wheels = Topic(participant, "rt/R1/cmd_vel", Twist)
    writer = DataWriter(participant, wheels, RELIABLE)
    grids = DataReader(
        participant, Topic(participant, "rt/map", OccupancyGrid), LATCHED
    )
    heard: list[dict[str, Any]] = []
    found: dict[str, Any] | None = None
    while (len(heard) < count or found is None) and not has_input_ended():
        for grid in grids.take(1):
            found = as_json(grid)
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
    sys.stdout.write(json.dumps({"scans": heard, "map": found}))
    del kept


def has_input_ended() -> bool:
    """Wait a little, and return whether there is something on standard input."""
    return bool(select.select([sys.stdin], [], [], POLL)[0])


if __name__ == "__main__":
    main()
