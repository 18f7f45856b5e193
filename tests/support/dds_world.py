"""Program: hear over DDS what a robot's world looks like, and print it as JSON.

Arguments: the domain and the name of the robot. It ends when it has heard of the scene,
the map, the robot's model, and a picture with its intrinsics. All but the picture may
were published before it came. Its types are written by hand, from the definitions of
ROS.
"""

import base64
import json
import sys
import time
from dataclasses import dataclass
from typing import Any

import dds_drive
from cyclonedds.core import Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, float64, int32, sequence, uint8, uint32
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

INTERVAL = 0.05  # s


@dataclass
class String(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    data: str


@dataclass
class ColorRGBA(IdlStruct, typename="std_msgs::msg::dds_::ColorRGBA_"):
    r: float32
    g: float32
    b: float32
    a: float32


@dataclass
class Duration(IdlStruct, typename="builtin_interfaces::msg::dds_::Duration_"):
    sec: int32
    nanosec: uint32


@dataclass
class CompressedImage(IdlStruct, typename="sensor_msgs::msg::dds_::CompressedImage_"):
    header: dds_drive.Header
    format: str
    data: sequence[uint8]  # type: ignore[type-arg]


@dataclass
class UVCoordinate(IdlStruct, typename="visualization_msgs::msg::dds_::UVCoordinate_"):
    u: float32
    v: float32


@dataclass
class MeshFile(IdlStruct, typename="visualization_msgs::msg::dds_::MeshFile_"):
    filename: str
    data: sequence[uint8]  # type: ignore[type-arg]


@dataclass
class Marker(IdlStruct, typename="visualization_msgs::msg::dds_::Marker_"):
    header: dds_drive.Header
    ns: str
    id: int32
    type: int32
    action: int32
    pose: dds_drive.Pose
    scale: dds_drive.Vector3
    color: ColorRGBA
    lifetime: Duration
    frame_locked: bool
    points: sequence[dds_drive.Point]  # type: ignore[type-arg]
    colors: sequence[ColorRGBA]  # type: ignore[type-arg]
    texture_resource: str
    texture: CompressedImage
    uv_coordinates: sequence[UVCoordinate]  # type: ignore[type-arg]
    text: str
    mesh_resource: str
    mesh_file: MeshFile
    mesh_use_embedded_materials: bool


@dataclass
class MarkerArray(IdlStruct, typename="visualization_msgs::msg::dds_::MarkerArray_"):
    markers: sequence[Marker]  # type: ignore[type-arg]


@dataclass
class RegionOfInterest(IdlStruct, typename="sensor_msgs::msg::dds_::RegionOfInterest_"):
    x_offset: uint32
    y_offset: uint32
    height: uint32
    width: uint32
    do_rectify: bool


@dataclass
class CameraInfo(IdlStruct, typename="sensor_msgs::msg::dds_::CameraInfo_"):
    header: dds_drive.Header
    height: uint32
    width: uint32
    distortion_model: str
    d: sequence[float64]  # type: ignore[type-arg]
    k: array[float64, 9]  # type: ignore[type-arg, valid-type]
    r: array[float64, 9]  # type: ignore[type-arg, valid-type]
    p: array[float64, 12]  # type: ignore[type-arg, valid-type]
    binning_x: uint32
    binning_y: uint32
    roi: RegionOfInterest


def summary(message: Any) -> Any:
    """Return what a test compares of a message."""
    match message:
        case MarkerArray():
            markers: Any = message.markers
            return [
                {"ns": each.ns, "alpha": each.color.a, "points": len(each.points)}
                for each in markers
            ]
        case dds_drive.OccupancyGrid():
            return dds_drive.as_json(message)
        case CompressedImage():
            data: Any = message.data
            return {
                "frame": message.header.frame_id,
                "jpeg": base64.b64encode(bytes(data)).decode(),
            }
        case CameraInfo():
            k: Any = message.k
            return {"size": [message.width, message.height], "k": list(k)}
        case _:
            return message.data


def main() -> None:
    domain, robot = int(sys.argv[1]), sys.argv[2]
    kept = Domain(domain, dds_drive.LOCAL)
    participant = DomainParticipant(domain)
    wanted: dict[str, tuple[type[IdlStruct], Qos]] = {
        "scene": (MarkerArray, dds_drive.LATCHED),
        "map": (dds_drive.OccupancyGrid, dds_drive.LATCHED),
        f"{robot}/robot_description": (String, dds_drive.LATCHED),
        f"{robot}/camera/image/compressed": (CompressedImage, dds_drive.RELIABLE),
        f"{robot}/camera/camera_info": (CameraInfo, dds_drive.RELIABLE),
    }
    readers = {
        name: DataReader(participant, Topic(participant, f"rt/{name}", type_), how)
        for name, (type_, how) in wanted.items()
    }
    heard: dict[str, Any] = {}
    while heard.keys() < readers.keys():
        time.sleep(INTERVAL)
        for name, reader in readers.items():
            for message in reader.take(1):
                heard[name] = summary(message)
    named = {name.removeprefix(f"{robot}/"): each for name, each in heard.items()}
    sys.stdout.write(json.dumps(named))
    del kept


if __name__ == "__main__":
    main()
