"""Loads recordings as numpy arrays.

The packages of the extra ``record`` are imported when a recording is read.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from radarsim.addons.fmcw.image_files import RadarTurn
from radarsim.addons.recording.bag_folder import RecordingInfo, open_bag
from radarsim.addons.recording.messages import ECHO
from radarsim.errors import RecordingError, import_optional
from radarsim.geometry import Floats

if TYPE_CHECKING:
    import xarray

    from radarsim.addons.recording.cdr import (
        Header,
        LaserScan,
        PointCloud2,
        Pose,
    )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ScanSeries:
    """The scans of a scanner, all with the same beams.

    Attributes:
        times: (T,) simulated times, s.
        ranges: (T, N) float32, m; inf for beams without return.
        angles: (N,) angles of the beams from the scanner's forward axis, rad,
            counter-clockwise.
        range_min: Minimum range, m, as last reported by the server.
        range_max: Maximum range, m, as last reported by the server.
        frame: Frame of the scanner.
    """

    times: Floats
    ranges: NDArray[np.float32]
    angles: Floats
    range_min: float
    range_max: float
    frame: str

    def __repr__(self) -> str:
        scans, beams = self.ranges.shape
        return f"<ScanSeries {self.frame}: {scans} scans of {beams} beams>"

    @classmethod
    def of(cls, messages: Sequence[LaserScan]) -> Self:
        """Create a series from messages with the same beams."""
        last = messages[-1]
        ranges = np.array([message.ranges for message in messages])
        # The first scans may lack the range limits, because clients may query them
        # later.
        ranges[ranges >= last.range_max] = np.inf
        return cls(
            times_of(message.header for message in messages),
            ranges,
            last.angle_min + last.angle_increment * np.arange(float(ranges.shape[1])),
            last.range_min,
            last.range_max,
            last.header.frame_id,
        )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PoseSeries:
    """The poses of a robot from one of its sensors.

    Attributes:
        times: (T,) simulated times, s.
        poses: (T, 6) x, y, z, m, and roll, pitch, yaw, rad.
        frame: Frame in which the poses are given.
    """

    times: Floats
    poses: Floats
    frame: str

    def __repr__(self) -> str:
        return f"<PoseSeries in {self.frame}: {len(self.times)} poses>"

    @classmethod
    def of(cls, messages: Sequence[tuple[Header, Pose]]) -> Self:
        """Create a series from the headers and poses of messages."""
        headers, poses = zip(*messages, strict=True)
        places = [[getattr(each.position, axis) for axis in "xyz"] for each in poses]
        xyzw = [[getattr(each.orientation, axis) for axis in "xyzw"] for each in poses]
        angles = Rotation.from_quat(xyzw).as_euler("ZYX")[:, ::-1]
        rows = np.hstack([places, angles])
        return cls(times_of(headers), rows, headers[0].frame_id)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class EchoSeries:
    """The echoes of a scanner as columns, one row for each echo, in order of scans.

    Attributes:
        times: (E,) simulated times of the scans, s.
        beams: (E,) number of the beam, counted from the right.
        points: (E, 3) float32, x, y, z in the frame of the scanner, m.
        strengths: (E,) float32, strength relative to a rough wall, 0 to 1.
        power: (E,) float32, remaining penetration power.
        kinds: (E,) str: ``enter``, ``hit`` and so on, as in ``Echoes``.
        objects: (E,) str, names of the objects.
        materials: (E,) str, names of their materials.
        frame: Frame of the scanner.
    """

    times: Floats
    beams: NDArray[np.uint16]
    points: NDArray[np.float32]
    strengths: NDArray[np.float32]
    power: NDArray[np.float32]
    kinds: NDArray[np.str_]
    objects: NDArray[np.str_]
    materials: NDArray[np.str_]
    frame: str

    def __len__(self) -> int:
        return len(self.times)

    def __repr__(self) -> str:
        return f"<EchoSeries {self.frame}: {len(self)} echoes>"

    @property
    def ranges(self) -> NDArray[np.float32]:
        """The distances from the scanner, (E,) float32, m."""
        lengths: NDArray[np.float32] = np.linalg.norm(self.points, axis=1)
        return lengths

    @classmethod
    def of(cls, messages: Sequence[PointCloud2], legend: str) -> Self:
        """Create a series from point clouds of echoes.

        Args:
            messages: The messages.
            legend: The last message of the topic ``/radarsim/legend``.
        """
        clouds = [np.frombuffer(message.data, ECHO) for message in messages]
        # The numbers in points are indices into the lists of the legend. The legend
        # only grows, so its last message is valid for all points.
        rows = np.concatenate(clouds)
        names = json.loads(legend)
        kinds, objects, materials = (
            np.array(names[key])[rows[key]] if len(rows) else np.array([], str)
            for key in ("kind", "object", "material")
        )
        times = times_of(message.header for message in messages)
        return cls(
            np.repeat(times, [len(cloud) for cloud in clouds]),
            rows["beam"],
            np.column_stack([rows["x"], rows["y"], rows["z"]]),
            rows["intensity"],
            rows["power"],
            kinds,
            objects,
            materials,
            messages[0].header.frame_id,
        )


def times_of(headers: Iterable[Header]) -> Floats:
    """Return the times in the headers of messages, (T,) s."""
    stamps = [header.stamp for header in headers]
    return np.array([stamp.sec + stamp.nanosec / 1e9 for stamp in stamps])


LEGEND: Final = "/radarsim/legend"
POSE: Final = ("x", "y", "z", "roll", "pitch", "yaw")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Recording:
    """The sensor readings of all robots of a run.

    The keys are topics without the first slash, and without ``/scan`` or ``/echoes``.
    If a scanner changes its beams during the run, its further scans are under its name
    with ``_2``, ``_3`` and so on.

    Attributes:
        folder: Folder of the recording.
        info: The conditions of the run.
        is_complete: Whether the file is complete, and not cut off.
        scans: The scans of each scanner, such as ``R1/lms200``.
        poses: The poses from each sensor, such as ``R1/ground_truth``.
        echoes: The echoes of each scanner.
    """

    folder: Path
    info: RecordingInfo
    is_complete: bool
    scans: dict[str, ScanSeries]
    poses: dict[str, PoseSeries]
    echoes: dict[str, EchoSeries]

    def __repr__(self) -> str:
        count = sum(len(each.times) for each in self.scans.values())
        return f"<Recording {self.folder}: {count} scans of {', '.join(self.scans)}>"

    def turns(self, scanner: str) -> Iterator[RadarTurn]:
        """Yield the revolutions of an FMCW radar, if they were recorded.

        Revolutions are read one at a time, because each has a megabyte or more.

        Args:
            scanner: The scanner, such as ``R1/Navtech``.

        Raises:
            RecordingError: If the file cannot be read any more.
        """
        from radarsim.addons.recording.cdr import Image, String, decode  # noqa: PLC0415

        topic = f"/{scanner}/spectrum"
        layout: dict[str, float] = {}
        try:
            for found, type_, data, _, _ in open_bag(self.folder).messages():
                # The layout is written once, before the first revolution.
                if found == f"{topic}/layout":
                    layout = json.loads(decode(type_, data, String).data)
                elif found == topic:
                    image = decode(type_, data, Image)
                    size, head = layout["bin_size"], int(layout["metadata_bytes"])
                    rows = image.data.reshape(image.height, image.width)
                    yield RadarTurn.of(rows, size, image.header.frame_id, head)
        except (ValueError, LookupError, TypeError) as error:
            raise _not_ours(self.folder, error) from error

    def to_xarray(self) -> xarray.DataTree:
        """Return the recording as a tree of xarray datasets.

        A scanner has the group ``scan`` with ``ranges`` by ``time`` and ``angle``, and
        the group ``echoes`` by ``echo``. A pose sensor has ``x`` to ``yaw`` by
        ``time``. For example, ``tree["R1/lms200/scan"].ranges`` are ranges of a laser.

        Raises:
            MissingPackage: If xarray is not installed.
        """
        package = import_optional("xarray", "tables")
        groups = {}
        for name, scans in self.scans.items():
            groups[f"/{name}/scan"] = package.Dataset(
                {"ranges": (("time", "angle"), scans.ranges, {"units": "m"})},
                {"time": scans.times, "angle": scans.angles},
                {
                    "frame": scans.frame,
                    "range_min": scans.range_min,
                    "range_max": scans.range_max,
                },
            )
        for name, poses in self.poses.items():
            axes = zip(POSE, poses.poses.T, strict=True)
            groups[f"/{name}"] = package.Dataset(
                {axis: ("time", column) for axis, column in axes},
                {"time": poses.times},
                {"frame": poses.frame},
            )
        for name, echoes in self.echoes.items():
            columns = {
                "beam": echoes.beams,
                **dict(zip("xyz", echoes.points.T, strict=True)),
                "range": echoes.ranges,
                "strength": echoes.strengths,
                "power": echoes.power,
                "kind": echoes.kinds,
                "object": echoes.objects,
                "material": echoes.materials,
            }
            groups[f"/{name}/echoes"] = package.Dataset(
                {key: ("echo", column) for key, column in columns.items()},
                {"time": ("echo", echoes.times)},
                {"frame": echoes.frame},
            )
        tree: xarray.DataTree = package.DataTree.from_dict(groups)
        tree.attrs = self.info.to_text()
        return tree


def load_recording(folder: Path | str) -> Recording:
    """Load a recording; an incomplete recording is loaded as far as it can be read.

    Args:
        folder: Folder of the recording.

    Raises:
        RecordingError: If the folder has no recording of radarsim, it cannot be read,
            or a package is missing; then the message names the extra.
    """
    bag = open_bag(Path(folder))
    from radarsim.addons.recording.cdr import (  # noqa: PLC0415
        LaserScan,
        Odometry,
        PointCloud2,
        PoseStamped,
        String,
        decode,
    )

    # Scans are grouped by their beams: a new resolution or field of view starts a new
    # series.
    scans: defaultdict[str, dict[tuple[float, ...], list[LaserScan]]]
    scans = defaultdict(dict)
    clouds: defaultdict[str, list[PointCloud2]] = defaultdict(list)
    poses: defaultdict[str, list[tuple[Header, Pose]]] = defaultdict(list)
    legend = ""
    try:
        for topic, type_, data, _, _ in bag.messages():
            name = topic.removeprefix("/")
            robot_or_scanner, _, last = name.rpartition("/")
            match last:
                case "scan":
                    scan = decode(type_, data, LaserScan)
                    beams = len(scan.ranges), scan.angle_min, scan.angle_increment
                    scans[robot_or_scanner].setdefault(beams, []).append(scan)
                case "echoes":
                    clouds[robot_or_scanner].append(decode(type_, data, PointCloud2))
                case "odom":
                    odometry = decode(type_, data, Odometry)
                    poses[name].append((odometry.header, odometry.pose.pose))
                case "ground_truth" | "ins":
                    placed = decode(type_, data, PoseStamped)
                    poses[name].append((placed.header, placed.pose))
                case _ if topic == LEGEND:
                    legend = decode(type_, data, String).data
        return Recording(
            bag.folder,
            bag.info,
            bag.is_complete,
            {
                name if number == 1 else f"{name}_{number}": ScanSeries.of(part)
                for name, parts in scans.items()
                for number, part in enumerate(parts.values(), 1)
            },
            {name: PoseSeries.of(each) for name, each in poses.items()},
            {name: EchoSeries.of(each, legend) for name, each in clouds.items()},
        )
    except (ValueError, LookupError) as error:
        raise _not_ours(Path(folder), error) from error


def _not_ours(folder: Path, error: Exception) -> RecordingError:
    return RecordingError(f"{folder}: {error}, expected topics of a radarsim run")
