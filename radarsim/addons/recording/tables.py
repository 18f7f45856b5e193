"""What a recording tells of scanners and poses: arrays, datasets and tables."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.recording.messages import ECHO
from radarsim.errors import import_optional
from radarsim.files import write_atomically
from radarsim.geometry import Floats

if TYPE_CHECKING:
    import xarray

    from radarsim.addons.recording.cdr import Header, LaserScan, PointCloud2, Pose
    from radarsim.addons.recording.recording import Recording

POSE: Final = ("x", "y", "z", "roll", "pitch", "yaw")
EXTRA: Final = "tables"

Columns: TypeAlias = dict[str, NDArray[np.generic] | list[NDArray[np.float32]]]


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
    def of(cls, messages: Sequence[LaserScan]) -> Self:
        """Collect messages of the same ``geometry_of``."""
        last = messages[-1]
        ranges = np.array([message.ranges for message in messages])
        # Clients may ask for the limits only after the first scans.
        ranges[ranges >= last.range_max] = np.inf
        return cls(
            times_of(message.header for message in messages),
            ranges,
            last.angle_min + last.angle_increment * np.arange(float(ranges.shape[1])),
            last.range_min,
            last.range_max,
            last.header.frame_id,
        )

    def columns(self) -> Columns:
        """Return a row for each scan."""
        count = len(self.times)
        step = self.angles[1] - self.angles[0] if len(self.angles) > 1 else 0.0
        return {
            "time": self.times,
            "angle_min": np.full(count, self.angles[0]),
            "angle_increment": np.full(count, step),
            "range_min": np.full(count, self.range_min),
            "range_max": np.full(count, self.range_max),
            "ranges": list(self.ranges),
        }


def geometry_of(scan: LaserScan) -> tuple[float, ...]:
    """Return what is the same in all scans of a series."""
    return len(scan.ranges), scan.angle_min, scan.angle_increment


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
    def of(
        cls,
        messages: Sequence[tuple[Header, Pose]],
    ) -> Self:
        """Collect what messages say."""
        headers, poses = zip(*messages, strict=True)
        rows = []
        for pose in poses:
            x, y, z, w = (getattr(pose.orientation, axis) for axis in "xyzw")
            roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
            # Rounding of the quaternion must not leave the domain of the sine.
            pitch = math.asin(min(1.0, max(-1.0, 2 * (w * y - z * x))))
            yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
            place = pose.position
            rows.append((place.x, place.y, place.z, roll, pitch, yaw))
        return cls(times_of(headers), np.array(rows), headers[0].frame_id)

    def columns(self) -> Columns:
        """Return a row for each pose."""
        return {"time": self.times, **dict(zip(POSE, self.poses.T, strict=True))}


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
    def of(cls, messages: Sequence[PointCloud2], legend: str) -> Self:
        """Collect messages of echoes.

        Args:
            messages: The messages.
            legend: The last text of the topic ``/radarsim/legend``.
        """
        clouds = [np.frombuffer(message.data, ECHO) for message in messages]
        # The numbers in points are places in the legend, which only grows: the last one
        # explains all.
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

    def columns(self) -> Columns:
        """Return a row for each echo."""
        return {
            "time": self.times,
            "beam": self.beams,
            **dict(zip("xyz", self.points.T, strict=True)),
            "range": self.ranges,
            "strength": self.strengths,
            "power": self.power,
            "kind": self.kinds,
            "object": self.objects,
            "material": self.materials,
        }


Series: TypeAlias = ScanSeries | PoseSeries | EchoSeries


def times_of(headers: Iterable[Header]) -> Floats:
    """Return the times in headers of messages, (T,) s."""
    stamps = [header.stamp for header in headers]
    return np.array([stamp.sec + stamp.nanosec / 1e9 for stamp in stamps])


def tree_of(recording: Recording) -> xarray.DataTree:
    """Return a recording as a tree; see ``Recording.to_xarray``."""
    package = import_optional("xarray", EXTRA)

    def dataset(dimension: str, series: PoseSeries | EchoSeries) -> xarray.Dataset:
        variables = {k: (dimension, column) for k, column in series.columns().items()}
        found: xarray.Dataset
        found = package.Dataset(variables, attrs={"frame": series.frame})
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
        groups[f"/{name}"] = dataset("time", poses)
    for name, echoes in recording.echoes.items():
        groups[f"/{name}/echoes"] = dataset("echo", echoes)
    tree: xarray.DataTree = package.DataTree.from_dict(groups)
    tree.attrs = recording.info.to_text()
    return tree


def write_parquet(recording: Recording, folder: Path) -> list[Path]:
    """Write a recording as tables; see ``Recording.to_parquet``."""
    arrow = import_optional("pyarrow", EXTRA)
    parquet = import_optional("pyarrow.parquet", EXTRA)
    tables: dict[str, tuple[str, Mapping[str, Series]]] = {
        "scans": ("scanner", recording.scans),
        "poses": ("source", recording.poses),
        "echoes": ("scanner", recording.echoes),
    }
    folder.mkdir(parents=True, exist_ok=True)
    contents = {}
    for table_name, (key, series) in tables.items():
        if not series:
            continue
        parts = [
            arrow.table({key: np.full(len(each.times), name), **each.columns()})
            for name, each in series.items()
        ]
        # All tables are made before the first file is written: all are there, or none.
        buffer = arrow.BufferOutputStream()
        parquet.write_table(arrow.concat_tables(parts), buffer)
        contents[folder / f"{table_name}.parquet"] = buffer.getvalue().to_pybytes()
    write_atomically(contents)
    return list(contents)
