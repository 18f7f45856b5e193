"""Recordings as arrays.

Turns of FMCW radars in recordings, as arrays.
"""

import json
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.fmcw.image_files import ENCODER_COUNTS
from radarsim.addons.recording.bag_folder import RecordingInfo, check_installed
from radarsim.addons.recording.message_types import decode
from radarsim.addons.recording.tables import (
    EchoSeries,
    Fields,
    PoseSeries,
    ScanSeries,
    geometry_of,
)
from radarsim.errors import RecordingError
from radarsim.geometry import Floats

if TYPE_CHECKING:
    import xarray


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
    def of(cls, image: Mapping[str, Any], layout: Mapping[str, Any]) -> Self:
        """Read a decoded message ``Image``.

        Args:
            image: The message.
            layout: Content of the topic ``spectrum/layout``.

        Raises:
            ValueError: If there are not as many bytes as rows need.
            KeyError: If the layout lacks something.
        """
        rows = image["data"].reshape(image["height"], image["width"])
        head, counts = np.split(rows, [layout["metadata_bytes"]], axis=1)
        times = head[:, :8].copy().view("<i8")[:, 0]
        encoder = head[:, 8:10].copy().view("<u2")[:, 0]
        return cls(
            times / 1e6,
            -2 * np.pi / ENCODER_COUNTS * encoder,
            layout["bin_size"] * np.arange(counts.shape[1]),
            counts,
            image["header"]["frame_id"],
        )


LEGEND = "/radarsim/legend"
POSES = ("ground_truth", "ins", "odom")  # last parts of topics


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
        from radarsim.addons.recording.bag_reader import BagReader  # noqa: PLC0415

        layout: dict[str, Any] = {}
        try:
            for topic, message, _, _ in BagReader(self.folder).messages():
                if topic == f"/{scanner}/spectrum/layout":
                    layout = json.loads(decode(message)["data"])
                elif topic == f"/{scanner}/spectrum":
                    yield RadarTurn.of(decode(message), layout)
        except (ValueError, LookupError) as error:
            raise _not_ours(self.folder, error) from error

    def to_xarray(self) -> "xarray.DataTree":
        """Return all as a tree of datasets.

        A scanner has ``scan`` with ``ranges`` by ``time`` and ``angle``, and
        ``echoes`` by ``echo``; each pose has ``x`` to ``yaw`` by ``time``. So
        ``tree["R1/lms200/scan"].ranges`` are the ranges of a scanner.

        Raises:
            MissingPackage: If xarray is not installed.
        """
        from radarsim.addons.recording.tables import tree_of  # noqa: PLC0415

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
        from radarsim.addons.recording.tables import write_parquet  # noqa: PLC0415

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
    from radarsim.addons.recording.bag_reader import BagReader  # noqa: PLC0415 - needs mcap

    bag = BagReader(Path(folder))
    messages: defaultdict[str, list[Fields]] = defaultdict(list)
    try:
        for topic, message, _, _ in bag.messages():
            if topic == LEGEND or _last_part(topic) in ("scan", "echoes", *POSES):
                messages[topic].append(decode(message))
        return Recording(
            bag.folder,
            bag.info,
            bag.is_complete,
            _scans(messages),
            {
                topic[1:]: PoseSeries.of(each)
                for topic, each in messages.items()
                if _last_part(topic) in POSES
            },
            _echoes(messages),
        )
    except (ValueError, LookupError) as error:
        raise _not_ours(Path(folder), error) from error


def _not_ours(folder: Path, error: Exception) -> RecordingError:
    return RecordingError(f"{folder}: {error}, expected topics of radarsim")


def _scans(messages: dict[str, list[Fields]]) -> dict[str, ScanSeries]:
    found: dict[str, ScanSeries] = {}
    for topic, each in messages.items():
        if _last_part(topic) != "scan":
            continue
        series: defaultdict[Any, list[Fields]] = defaultdict(list)
        for message in each:
            series[geometry_of(message)].append(message)
        for number, scans in enumerate(series.values(), 1):
            name = topic[1:].removesuffix("/scan")
            found[name if number == 1 else f"{name}_{number}"] = ScanSeries.of(scans)
    return found


def _echoes(messages: dict[str, list[Fields]]) -> dict[str, EchoSeries]:
    return {
        topic[1:].removesuffix("/echoes"): EchoSeries.of(
            each, messages[LEGEND][-1]["data"]
        )
        for topic, each in messages.items()
        if _last_part(topic) == "echoes"
    }


def _last_part(topic: str) -> str:
    return topic.rpartition("/")[2]
