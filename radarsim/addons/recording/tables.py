"""Recordings as datasets of xarray, and as tables of Parquet.

What a recording tells of scanners and poses, as arrays.
"""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.recording.messages import ECHO
from radarsim.errors import import_optional
from radarsim.files import write_atomically
from radarsim.geometry import Floats

if TYPE_CHECKING:
    import xarray

    from radarsim.addons.recording.recording import Recording

Fields = Mapping[str, Any]  # a decoded message


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ScanSeries:
    """The scans of a scanner, all with the same beams.

    Attributes:
        times: (T,) simulated times, s.
        ranges: (T, N) float32, m; inf where nothing came back.
        angles: (N,) directions of the beams from the scanner's forward axis, rad,
            counter-clockwise.
        range_min: Minimum range, m, as last told by the server.
        range_max: Maximum range, m, likewise.
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
    def of(cls, messages: Sequence[Fields]) -> Self:
        """Collect decoded messages ``LaserScan`` of the same ``geometry_of``."""
        last = messages[-1]
        ranges = np.array([message["ranges"] for message in messages])
        # Clients may ask for the limits only after the first scans.
        ranges[ranges >= last["range_max"]] = np.inf
        return cls(
            times_of(messages),
            ranges,
            last["angle_min"] + last["angle_increment"] * np.arange(ranges.shape[1]),
            last["range_min"],
            last["range_max"],
            last["header"]["frame_id"],
        )


def geometry_of(scan: Fields) -> tuple[float, ...]:
    """Return what is the same in all scans of a series."""
    return len(scan["ranges"]), scan["angle_min"], scan["angle_increment"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PoseSeries:
    """The poses of a robot by one of its sensors.

    Attributes:
        times: (T,) simulated times, s.
        poses: (T, 6) x, y, z, m, and roll, pitch, yaw, rad.
        frame: Frame that the poses are in.
    """

    times: Floats
    poses: Floats
    frame: str

    def __repr__(self) -> str:
        return f"<PoseSeries in {self.frame}: {len(self.times)} poses>"

    @classmethod
    def of(cls, messages: Sequence[Fields]) -> Self:
        """Collect decoded messages ``PoseStamped`` or ``Odometry``."""
        poses = np.array([_pose_of(message) for message in messages])
        return cls(times_of(messages), poses, messages[0]["header"]["frame_id"])


def _pose_of(message: Fields) -> tuple[float, ...]:
    pose = message["pose"]
    pose = pose.get("pose", pose)  # of odometry it has a covariance beside it
    position, turned = pose["position"], pose["orientation"]
    angles = _angles_of(turned["x"], turned["y"], turned["z"], turned["w"])
    return position["x"], position["y"], position["z"], *angles


def _angles_of(x: float, y: float, z: float, w: float) -> tuple[float, float, float]:
    """Return roll, pitch and yaw of a unit quaternion, rad."""
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(min(1.0, max(-1.0, 2 * (w * y - z * x))))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return roll, pitch, yaw


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class EchoSeries:
    """The echoes of a scanner as columns, a row each: scan by scan.

    Attributes:
        times: (E,) simulated times of the scans, s.
        beams: (E,) number of the beam, counted from the right.
        points: (E, 3) float32, x, y, z in the frame of the scanner, m.
        strengths: (E,) float32, share of what a rough wall sends back, 0 to 1.
        power: (E,) float32, penetration power that is left.
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
    def of(cls, messages: Sequence[Fields], legend: str) -> Self:
        """Collect decoded messages ``PointCloud2`` of echoes.

        Args:
            messages: The messages.
            legend: The last text of the topic ``/radarsim/legend``.
        """
        clouds = [np.frombuffer(message["data"], ECHO) for message in messages]
        rows = np.concatenate(clouds)
        names = json.loads(legend)
        kinds, objects, materials = (
            np.array(names[key])[rows[key]] if len(rows) else np.array([], str)
            for key in ("kind", "object", "material")
        )
        return cls(
            np.repeat(times_of(messages), [len(cloud) for cloud in clouds]),
            rows["beam"],
            np.column_stack([rows["x"], rows["y"], rows["z"]]),
            rows["intensity"],
            rows["power"],
            kinds,
            objects,
            materials,
            messages[0]["header"]["frame_id"],
        )


def times_of(messages: Sequence[Fields]) -> Floats:
    """Return the times in the headers of decoded messages, (T,) s."""
    stamps = [message["header"]["stamp"] for message in messages]
    return np.array([stamp["sec"] + stamp["nanosec"] / 1e9 for stamp in stamps])


POSE: Final = ("x", "y", "z", "roll", "pitch", "yaw")
EXTRA: Final = "tables"

Columns = dict[str, Any]


def tree_of(recording: "Recording") -> "xarray.DataTree":
    """Return a recording as a tree; see ``Recording.to_xarray``."""
    package = import_optional("xarray", EXTRA)

    def dataset(dimension: str, columns: Columns, frame: str) -> "xarray.Dataset":
        variables = {name: (dimension, column) for name, column in columns.items()}
        found: xarray.Dataset = package.Dataset(variables, attrs={"frame": frame})
        return found.set_coords("time")

    groups = {}
    for name, scans in recording.scans.items():
        groups[f"/{name}/scan"] = package.Dataset(
            {"ranges": (("time", "angle"), scans.ranges, {"units": "m"})},
            {"time": scans.times, "angle": scans.angles},
            {
                "frame": scans.frame,
                "range_min": scans.range_min,
                "range_max": scans.range_max,
            },
        )
    for name, poses in recording.poses.items():
        groups[f"/{name}"] = dataset("time", _pose_columns(poses), poses.frame)
    for name, echoes in recording.echoes.items():
        groups[f"/{name}/echoes"] = dataset("echo", _echo_columns(echoes), echoes.frame)
    tree: xarray.DataTree = package.DataTree.from_dict(groups)
    tree.attrs = recording.info.to_text()
    return tree


def write_parquet(recording: "Recording", folder: Path) -> list[Path]:
    """Write a recording as tables; see ``Recording.to_parquet``."""
    arrow = import_optional("pyarrow", EXTRA)
    parquet = import_optional("pyarrow.parquet", EXTRA)
    tables = {
        "scans": _joined("scanner", recording.scans, _scan_columns),
        "poses": _joined("source", recording.poses, _pose_columns),
        "echoes": _joined("scanner", recording.echoes, _echo_columns),
    }
    folder.mkdir(parents=True, exist_ok=True)
    contents = {}
    for name, columns in tables.items():
        parts = [arrow.table(part) for part in columns]
        if not parts:
            continue
        table = arrow.concat_tables(parts)
        buffer = arrow.BufferOutputStream()
        parquet.write_table(table, buffer)
        contents[folder / f"{name}.parquet"] = buffer.getvalue().to_pybytes()
    write_atomically(contents)
    return list(contents)


def _joined(
    key: str, series: Mapping[str, Any], columns_of: Callable[[Any], Columns]
) -> Iterator[Columns]:
    """Yield the columns of each series, with its name in the first."""
    for name, each in series.items():
        yield {key: np.full(len(each.times), name), **columns_of(each)}


def _scan_columns(scans: ScanSeries) -> Columns:
    count = len(scans.times)
    step = scans.angles[1] - scans.angles[0] if len(scans.angles) > 1 else 0.0
    return {
        "time": scans.times,
        "angle_min": np.full(count, scans.angles[0]),
        "angle_increment": np.full(count, step),
        "range_min": np.full(count, scans.range_min),
        "range_max": np.full(count, scans.range_max),
        "ranges": list(scans.ranges),
    }


def _pose_columns(poses: PoseSeries) -> Columns:
    return {"time": poses.times, **dict(zip(POSE, poses.poses.T, strict=True))}


def _echo_columns(echoes: EchoSeries) -> Columns:
    return {
        "time": echoes.times,
        "beam": echoes.beams,
        **dict(zip("xyz", echoes.points.T, strict=True)),
        "range": echoes.ranges,
        "strength": echoes.strengths,
        "power": echoes.power,
        "kind": echoes.kinds,
        "object": echoes.objects,
        "material": echoes.materials,
    }
