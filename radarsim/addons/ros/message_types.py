"""Definitions of the types of ROS 2 that topics have, for clients of rosapi.

Source: the packages common_interfaces, geometry2 and rcl_interfaces of ROS 2 Jazzy.
They are here as rosbridge needs no package for ROS.
"""

import re
from collections.abc import Iterator
from typing import Any, Final

# Types and names of the fields of each type, in their order.
FIELDS: Final = {
    "builtin_interfaces/msg/Duration": "int32 sec, uint32 nanosec",
    "builtin_interfaces/msg/Time": "int32 sec, uint32 nanosec",
    "geometry_msgs/msg/Point": "float64 x, float64 y, float64 z",
    "geometry_msgs/msg/Pose": "geometry_msgs/Point position,"
    " geometry_msgs/Quaternion orientation",
    "geometry_msgs/msg/PoseStamped": "std_msgs/Header header, geometry_msgs/Pose pose",
    "geometry_msgs/msg/PoseWithCovariance": "geometry_msgs/Pose pose,"
    " float64[36] covariance",
    "geometry_msgs/msg/Quaternion": "float64 x, float64 y, float64 z, float64 w",
    "geometry_msgs/msg/Transform": "geometry_msgs/Vector3 translation,"
    " geometry_msgs/Quaternion rotation",
    "geometry_msgs/msg/TransformStamped": "std_msgs/Header header,"
    " string child_frame_id, geometry_msgs/Transform transform",
    "geometry_msgs/msg/Twist": "geometry_msgs/Vector3 linear,"
    " geometry_msgs/Vector3 angular",
    "geometry_msgs/msg/TwistStamped": "std_msgs/Header header,"
    " geometry_msgs/Twist twist",
    "geometry_msgs/msg/TwistWithCovariance": "geometry_msgs/Twist twist,"
    " float64[36] covariance",
    "geometry_msgs/msg/Vector3": "float64 x, float64 y, float64 z",
    "nav_msgs/msg/MapMetaData": "builtin_interfaces/Time map_load_time,"
    " float32 resolution, uint32 width, uint32 height, geometry_msgs/Pose origin",
    "nav_msgs/msg/OccupancyGrid": "std_msgs/Header header, nav_msgs/MapMetaData info,"
    " int8[] data",
    "nav_msgs/msg/Odometry": "std_msgs/Header header, string child_frame_id,"
    " geometry_msgs/PoseWithCovariance pose, geometry_msgs/TwistWithCovariance twist",
    "rosgraph_msgs/msg/Clock": "builtin_interfaces/Time clock",
    "sensor_msgs/msg/CameraInfo": "std_msgs/Header header, uint32 height,"
    " uint32 width, string distortion_model, float64[] d, float64[9] k, float64[9] r,"
    " float64[12] p, uint32 binning_x, uint32 binning_y,"
    " sensor_msgs/RegionOfInterest roi",
    "sensor_msgs/msg/CompressedImage": "std_msgs/Header header, string format,"
    " uint8[] data",
    "sensor_msgs/msg/LaserScan": "std_msgs/Header header, float32 angle_min,"
    " float32 angle_max, float32 angle_increment, float32 time_increment,"
    " float32 scan_time, float32 range_min, float32 range_max, float32[] ranges,"
    " float32[] intensities",
    "sensor_msgs/msg/PointCloud2": "std_msgs/Header header, uint32 height,"
    " uint32 width, sensor_msgs/PointField[] fields, bool is_bigendian,"
    " uint32 point_step, uint32 row_step, uint8[] data, bool is_dense",
    "sensor_msgs/msg/PointField": "string name, uint32 offset, uint8 datatype,"
    " uint32 count",
    "sensor_msgs/msg/RegionOfInterest": "uint32 x_offset, uint32 y_offset,"
    " uint32 height, uint32 width, bool do_rectify",
    "std_msgs/msg/ColorRGBA": "float32 r, float32 g, float32 b, float32 a",
    "std_msgs/msg/Header": "builtin_interfaces/Time stamp, string frame_id",
    "std_msgs/msg/String": "string data",
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "visualization_msgs/msg/Marker": "std_msgs/Header header, string ns, int32 id,"
    " int32 type, int32 action, geometry_msgs/Pose pose, geometry_msgs/Vector3 scale,"
    " std_msgs/ColorRGBA color, builtin_interfaces/Duration lifetime,"
    " bool frame_locked, geometry_msgs/Point[] points, std_msgs/ColorRGBA[] colors,"
    " string texture_resource, sensor_msgs/CompressedImage texture,"
    " visualization_msgs/UVCoordinate[] uv_coordinates, string text,"
    " string mesh_resource, visualization_msgs/MeshFile mesh_file,"
    " bool mesh_use_embedded_materials",
    "visualization_msgs/msg/MarkerArray": "visualization_msgs/Marker[] markers",
    "visualization_msgs/msg/MeshFile": "string filename, uint8[] data",
    "visualization_msgs/msg/UVCoordinate": "float32 u, float32 v",
}
_FIELD: Final = re.compile(r"([\w/]+)(\[(\d*)\])? (\w+)")


def full_name(name: str) -> str:
    """Return the name of a type as ROS 2 has it.

    >>> full_name("std_msgs/Header"), full_name("std_msgs/msg/Header")
    ('std_msgs/msg/Header', 'std_msgs/msg/Header')
    """
    package, _, rest = name.partition("/")
    return name if rest.startswith("msg/") or not rest else f"{package}/msg/{rest}"


def types_within(name: str) -> Iterator[str]:
    """Yield a type, and then those of the fields of messages in it, each once.

    Args:
        name: Full name of the type; nothing is yielded if it is not known.
    """
    found = [name] if name in FIELDS else []
    for each in found:
        yield each
        inner = (full_name(type_) for type_, *_ in _FIELD.findall(FIELDS[each]))
        found += [type_ for type_ in inner if type_ in FIELDS and type_ not in found]


def type_definition(name: str) -> dict[str, Any]:
    """Return a type as ``rosapi/TypeDef``: arrays have a length, 0 if it may change.

    Args:
        name: Full name of a type that is known.
    """
    types, brackets, lengths, names = zip(*_FIELD.findall(FIELDS[name]), strict=True)
    return {
        "type": name,
        "fieldnames": list(names),
        "fieldtypes": [full_name(each) for each in types],
        "fieldarraylen": [
            int(length or 0) if bracket else -1
            for bracket, length in zip(brackets, lengths, strict=True)
        ],
        "examples": ["[]" if each else "" for each in brackets],
        "constnames": [],
        "constvalues": [],
    }


def full_text(name: str) -> str:
    """Return the definition of a type with those in it; empty if it is not known."""
    parts = [
        (f"{'=' * 80}\nMSG: {each.replace('/msg/', '/')}\n" if each != name else "")
        + FIELDS[each].replace(", ", "\n")
        for each in types_within(name)
    ]
    return "\n".join(parts)
