"""Recordings as arrays.

Imports no package of the extra ``record`` before a recording is read.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.fmcw.image_files import ENCODER_COUNTS
from radarsim.addons.recording.bag_folder import RecordingInfo, check_installed
from radarsim.addons.recording.tables import (
    EchoSeries,
    PoseSeries,
    ScanSeries,
    geometry_of,
    tree_of,
    write_parquet,
)
from radarsim.errors import RecordingError
from radarsim.geometry import Floats

if TYPE_CHECKING:
    import xarray

    from radarsim.addons.recording.cdr import (
        Header,
        Image,
        LaserScan,
        PointCloud2,
        Pose,
    )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RadarTurn:
    """What an FMCW radar received in one turn: A directions of B range bins.

    Attributes:
        times: (A,) simulated times, s.
        angles: (A,) directions, rad, counter-clockwise from straight ahead; they fall
            from 0 to -2 pi, as the radar turns clockwise.
        ranges: (B,) m.
        counts: (A, B) uint8, the power as the radar stores it.
        frame: Frame of the radar.
    """

    times: Floats
    angles: Floats
    ranges: Floats
    counts: NDArray[np.uint8]
    frame: str

    def __repr__(self) -> str:
        azimuths, bins = self.counts.shape
        return f"<RadarTurn {self.frame}: {azimuths} azimuths of {bins} bins>"

    @classmethod
    def of(cls, image: Image, bin_size: float, metadata_bytes: int) -> Self:
        """Read a message.

        Args:
            image: The message.
            bin_size: Distance between range bins, m.
            metadata_bytes: Bytes of a row before the counts.

        Raises:
            ValueError: If there are not as many bytes as rows need.
        """
        rows = image.data.reshape(image.height, image.width)
        head, counts = np.split(rows, [metadata_bytes], axis=1)
        # The views need contiguous bytes, which columns of a row are not.
        times = head[:, :8].copy().view("<i8")[:, 0]
        encoder = head[:, 8:10].copy().view("<u2")[:, 0]
        return cls(
            times / 1e6,
            -2 * np.pi / ENCODER_COUNTS * encoder,
            bin_size * np.arange(float(counts.shape[1])),
            counts,
            image.header.frame_id,
        )


LEGEND = "/radarsim/legend"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Recording:
    """What the robots of a run sensed.

    The keys are topics without the first slash, and without ``/scan`` or ``/echoes``.
    Scans of one scanner that has got other beams meanwhile are under its name with
    ``_2``, ``_3`` and so on.

    Attributes:
        folder: Folder of the recording.
        info: The conditions of the run.
        is_complete: Whether the file has its end.
        scans: The scans of each scanner, such as ``R1/lms200``.
        poses: The poses by each sensor, such as ``R1/ground_truth``.
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
        """Yield the turns of an FMCW radar, if they were recorded.

        They are read one after the other, as each has a megabyte or more.

        Args:
            scanner: The scanner, such as ``R1/Navtech``.

        Raises:
            RecordingError: If the file cannot be read any more.
        """
        from radarsim.addons.recording.bag import BagReader  # noqa: PLC0415
        from radarsim.addons.recording.cdr import Image, String, decode  # noqa: PLC0415

        topic = f"/{scanner}/spectrum"
        layout: dict[str, float] = {}
        try:
            for found, message, _, _ in BagReader(self.folder).messages():
                # It is latched, and written before the first turn.
                if found == f"{topic}/layout":
                    layout = json.loads(decode(message, String).data)
                elif found == topic:
                    image = decode(message, Image)
                    size, head = layout["bin_size"], int(layout["metadata_bytes"])
                    yield RadarTurn.of(image, size, head)
        except (ValueError, LookupError, TypeError) as error:
            raise _not_ours(self.folder, error) from error

    def to_xarray(self) -> xarray.DataTree:
        """Return all as a tree of datasets.

        A scanner has ``scan`` with ``ranges`` by ``time`` and ``angle``, and
        ``echoes`` by ``echo``; each pose has ``x`` to ``yaw`` by ``time``. So
        ``tree["R1/lms200/scan"].ranges`` are the ranges of a scanner.

        Raises:
            MissingPackage: If xarray is not installed.
        """
        return tree_of(self)

    def to_parquet(self, folder: Path | str) -> list[Path]:
        """Write ``scans.parquet``, ``poses.parquet`` and ``echoes.parquet``.

        Each has a row for each scan, pose or echo, with the key in the first column.
        What there is nothing of has no file.

        Args:
            folder: Where to write them; it is created if it is not there. Files that
                are there are replaced.

        Returns:
            The paths of the files.

        Raises:
            MissingPackage: If pyarrow is not installed.
            OSError: If a file cannot be written.
        """
        return write_parquet(self, Path(folder))


def load_recording(folder: Path | str) -> Recording:
    """Read a recording, also one that breaks off, as far as it goes.

    Args:
        folder: Folder of the recording.

    Raises:
        RecordingError: If it is no recording of radarsim, or cannot be read; or if a
            package is missing, and then it names the extra.
    """
    check_installed()
    from radarsim.addons.recording.bag import BagReader  # noqa: PLC0415
    from radarsim.addons.recording.cdr import (  # noqa: PLC0415
        LaserScan,
        Odometry,
        PointCloud2,
        PoseStamped,
        String,
        decode,
    )

    bag = BagReader(Path(folder))
    scans: defaultdict[str, list[LaserScan]] = defaultdict(list)
    clouds: defaultdict[str, list[PointCloud2]] = defaultdict(list)
    poses: defaultdict[str, list[tuple[Header, Pose]]] = defaultdict(list)
    legend = ""
    try:
        for topic, message, _, _ in bag.messages():
            name = topic.removeprefix("/")
            robot_or_scanner, _, last = name.rpartition("/")
            match last:
                case "scan":
                    scan = decode(message, LaserScan)
                    scans[robot_or_scanner].append(scan)
                case "echoes":
                    cloud = decode(message, PointCloud2)
                    clouds[robot_or_scanner].append(cloud)
                case "odom":
                    odometry = decode(message, Odometry)
                    poses[name].append((odometry.header, odometry.pose.pose))
                case "ground_truth" | "ins":
                    placed = decode(message, PoseStamped)
                    poses[name].append((placed.header, placed.pose))
                case _ if topic == LEGEND:
                    legend = decode(message, String).data
        series: dict[str, ScanSeries] = {}
        for name, each in scans.items():
            # Another resolution or field of view begins another series.
            same: defaultdict[tuple[float, ...], list[LaserScan]] = defaultdict(list)
            for scan in each:
                same[geometry_of(scan)].append(scan)
            for number, part in enumerate(same.values(), 1):
                key = name if number == 1 else f"{name}_{number}"
                series[key] = ScanSeries.of(part)
        return Recording(
            bag.folder,
            bag.info,
            bag.is_complete,
            series,
            {name: PoseSeries.of(each) for name, each in poses.items()},
            {name: EchoSeries.of(each, legend) for name, each in clouds.items()},
        )
    except (ValueError, LookupError) as error:
        raise _not_ours(Path(folder), error) from error


def _not_ours(folder: Path, error: Exception) -> RecordingError:
    return RecordingError(f"{folder}: {error}, expected topics of radarsim")
