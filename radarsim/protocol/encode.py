"""Reports to lines: one encoder, which looks up in the dialect what differs.

A line is ASCII, has single blanks, and never holds an exponent or what is not a
number. Positions and angles change from the simulation's frame to the wire's here.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import singledispatch
from itertools import accumulate

from radarsim.geometry import Pose3, wrap_angle
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.echoes import echo_fields
from radarsim.protocol.message import (
    Message,
    Triple,
    angles_on_wire,
    flip_axes,
    position_on_wire,
)
from radarsim.protocol.numbers import NumberFormat, format_ranges
from radarsim.protocol.reports import (
    READING_TYPES,
    SETTING_KEYS,
    VEHICLE,
    EchoLine,
    Encoder,
    EncoderConf,
    Greeting,
    GroundTruth,
    Ins,
    IntervalConf,
    ItemGeo,
    NameConf,
    Odometry,
    RangeScan,
    Reading,
    Report,
    RobotConf,
    RobotGeo,
    ScannerConf,
    Settings,
    StartPoses,
    Status,
    Tachometer,
    Touch,
    TouchConf,
)

LONGEST_LINE = 4095  # bytes with its end; clients read into buffers of 4096

Fields = Iterable[tuple[str, str]]


def encode_report(report: Report, dialect: Dialect) -> str:
    """Write a report as one line, without its end.

    Raises:
        ValueError: If a number in it is not finite.
    """
    return _line(report, dialect)


def to_bytes(lines: Iterable[str]) -> bytes:
    r"""Join lines to what is sent, each with CRLF.

    >>> to_bytes(["NFO {StartPoses 0}"])
    b'NFO {StartPoses 0}\r\n'
    """
    return "".join([f"{line}\r\n" for line in lines]).encode("ascii", "replace")


@singledispatch
def _line(report: object, dialect: Dialect) -> str:
    raise TypeError(f"{report!r} to {dialect.name}, expected a report")


@_line.register
def _(report: Greeting, dialect: Dialect) -> str:
    return _text(
        "NFO",
        ("Gametype", dialect.gametype),
        ("Level", report.level),
        ("TimeLimit", str(dialect.time_limit)),
    )


@_line.register
def _(report: StartPoses, dialect: Dialect) -> str:
    join = dialect.start_pose.join
    poses = _what_fits(
        [
            f"{name} {join(position_on_wire(pose))} {join(_wrapped(pose))}"
            for name, pose in report.poses
        ]
    )
    count = f"NFO {{StartPoses {len(poses)}}}"
    return f"{count} {{{' '.join(poses)}}}" if poses else count


def _what_fits(poses: Sequence[str]) -> Sequence[str]:
    """Drop whole poses from the end until the answer fits into one read."""
    room = LONGEST_LINE - len("NFO {StartPoses 1000} {}\r\n")
    ends = accumulate(len(pose) + 1 for pose in poses)
    return poses[: sum(end - 1 <= room for end in ends)]


@_line.register
def _(report: Status, dialect: Dialect) -> str:
    least = 0 if dialect.battery_runs_out else 1
    values = {
        "Type": VEHICLE,
        "Time": dialect.time.text(report.time),
        "FrontSteer": dialect.steer,
        "RearSteer": dialect.steer,
        "LightToggle": str(report.light),
        "LightIntensity": dialect.light_intensity[report.light],
        "Battery": str(max(report.battery, least)),
        "View": "-1",
    }
    return _text("STA", *_pick(dialect.status_keys, values))


@_line.register
def _(report: RangeScan, dialect: Dialect) -> str:
    return _sensor(
        report,
        dialect,
        ("Name", report.name),
        ("Resolution", dialect.angle.text(report.resolution)),
        ("FOV", dialect.angle.text(report.fov)),
        ("Range", format_ranges(report.ranges, dialect.ranges)),
    )


@_line.register
def _(report: EchoLine, dialect: Dialect) -> str:
    return _sensor(report, dialect, *echo_fields(report, dialect))


@_line.register
def _(report: GroundTruth, dialect: Dialect) -> str:
    return _sensor(
        report,
        dialect,
        ("Name", report.name),
        ("Location", dialect.truth.join(position_on_wire(report.pose))),
        ("Orientation", dialect.truth.join(_wrapped(report.pose))),
    )


@_line.register
def _(report: Ins, dialect: Dialect) -> str:
    angles: Iterable[float] = _wrapped(report.pose)
    if dialect.ins_angles_positive:
        angles = [angle % (2 * math.pi) for angle in angles]
    return _sensor(
        report,
        dialect,
        ("Name", report.name),
        ("Location", dialect.ins.join(position_on_wire(report.pose))),
        ("Orientation", dialect.ins.join(angles)),
    )


@_line.register
def _(report: Odometry, dialect: Dialect) -> str:
    x, y, yaw = report.pose.x, report.pose.y, report.pose.yaw
    on_wire = (x, 0.0 - y, 0.0 - yaw)
    return _sensor(
        report,
        dialect,
        ("Name", report.name),
        ("Pose", dialect.plain.join(on_wire)),
    )


@_line.register
def _(report: Tachometer, dialect: Dialect) -> str:
    return _sensor(
        report,
        dialect,
        ("Name", report.name),
        ("Vel", dialect.plain.join(report.velocities)),
        ("Pos", dialect.plain.join(report.positions)),
    )


@_line.register
def _(report: Encoder, dialect: Dialect) -> str:
    pairs = [(("Name", name), ("Tick", str(tick))) for name, tick in report.ticks]
    fields = [field for pair in pairs for field in pair]
    return _sensor(report, dialect, *fields)


@_line.register
def _(report: Touch, dialect: Dialect) -> str:
    return _sensor(
        report,
        dialect,
        ("Name", report.name),
        ("Touch", str(report.touched)),
    )


@_line.register
def _(report: RobotGeo, dialect: Dialect) -> str:
    number = dialect.robot
    size = report.dimensions
    if dialect.dimensions_are_wheels:
        size = (report.wheel_base, report.wheel_separation, 0.0)
    return _text(
        "GEO",
        ("Type", VEHICLE),
        ("Name", report.name),
        ("Dimensions", number.join(size)),
        ("COG", number.join(flip_axes(report.cog))),
        ("WheelRadius", number.text(report.wheel_radius)),
        ("WheelSeparation", number.text(report.wheel_separation)),
        ("WheelBase", number.text(report.wheel_base)),
    )


@_line.register
def _(report: RobotConf, dialect: Dialect) -> str:
    values = {
        "Type": VEHICLE,
        "Name": report.name,
        "SteeringType": "SkidSteered",
        "Mass": dialect.mass.text(report.mass),
        "MaxSpeed": dialect.robot.text(report.max_speed),
        "MaxTorque": dialect.robot.text(report.max_torque),
        "MaxFrontSteer": dialect.steer,
        "MaxRearSteer": dialect.steer,
    }
    return _text("CONF", *_pick(dialect.robot_conf_keys, values))


@_line.register
def _(report: ItemGeo, dialect: Dialect) -> str:
    join = dialect.mount.join
    mounts = [
        dialect.mount_form.format(
            name=name,
            location=join(position_on_wire(pose)),
            orientation=join(angles_on_wire(pose)),
            robot=report.robot,
        )
        for name, pose in report.mounts
    ]
    return " ".join([_text("GEO", ("Type", report.type)), *mounts])


@_line.register
def _(report: ScannerConf, dialect: Dialect) -> str:
    fields: list[tuple[str, str]] = []
    for name, max_range, min_range, resolution, fov in report.items:
        values = {
            "Name": name,
            "MaxRange": dialect.robot.text(max_range),
            "MinRange": dialect.robot.text(min_range),
            "Resolution": dialect.angle.text(resolution),
            "Fov": dialect.angle.text(fov),
            "Panning": "True",
            "Tilting": "False",
        }
        fields += _pick(dialect.scanner_conf_keys, values)
    return _text("CONF", ("Type", report.type), *fields)


@_line.register
def _(report: IntervalConf, dialect: Dialect) -> str:
    return _settings(report, dialect.plain)


@_line.register
def _(report: EncoderConf, dialect: Dialect) -> str:
    return _settings(report, dialect.angle)


@_line.register
def _(report: TouchConf, dialect: Dialect) -> str:
    return _settings(report, dialect.robot)


@_line.register
def _(report: NameConf, dialect: Dialect) -> str:  # noqa: ARG001
    return _text("CONF", ("Type", report.type), *(("Name", n) for n in report.names))


def _text(verb: str, *fields: tuple[str, str]) -> str:
    return Message(verb, fields).encode()


def _sensor(report: Reading, dialect: Dialect, *fields: tuple[str, str]) -> str:
    kind = ("Type", READING_TYPES[type(report)])
    if isinstance(report, Ins) and not dialect.ins_has_time:
        return _text("SEN", kind, *fields)
    return _text("SEN", ("Time", dialect.time.text(report.time)), kind, *fields)


def _settings(report: Settings, form: NumberFormat) -> str:
    key = SETTING_KEYS[type(report)]
    fields: list[tuple[str, str]] = []
    for name, value in report.items:
        fields += [("Name", name), (key, form.text(value))]
    return _text("CONF", ("Type", report.type), *fields)


def _pick(keys: Iterable[str], values: Mapping[str, str]) -> Fields:
    return [(key, values[key]) for key in keys]


def _wrapped(pose: Pose3) -> Triple:
    """Give roll, pitch, yaw on the wire, each in (-pi, pi]."""
    roll, pitch, yaw = angles_on_wire(pose)
    return (wrap_angle(roll), wrap_angle(pitch), wrap_angle(yaw))
