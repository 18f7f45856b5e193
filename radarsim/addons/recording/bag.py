"""Bags of ROS 2: a folder with an MCAP file and its metadata, written and read.

Every topic has the definition and the hash of its type, so that a bag can be read and
played without radarsim. Messages are kept in chunks of 64 KiB or a second, each of
which goes to the file at once when it is full: a process that is killed loses at most
one. A file that ends in the middle of a record is read up to there.

Source: the MCAP specification and its profile ``ros2``; metadata of rosbag2, version 9.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

import yaml
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, SeekingReader
from mcap.records import Metadata
from mcap.stream_reader import CRCValidationError, StreamReader
from mcap.writer import CompressionType, Writer
from zstandard import ZstdError

from radarsim.addons.recording.bag_folder import (
    RecordingInfo,
    file_name,
    find_file,
    lock,
)
from radarsim.addons.recording.call_converter import TO_CLIENT, TO_SERVER
from radarsim.addons.recording.cdr import (
    UInt8MultiArray,
    decode,
    definition_of,
    typestore,
)
from radarsim.addons.recording.recorders import EventType, RunEvent
from radarsim.errors import RecordingError, describe_os_error
from radarsim.files import write_atomically

CHUNK_BYTES: Final = 64 * 1024
FLUSH_INTERVAL: Final = 1_000_000_000  # ns of recorded time
METADATA_VERSION: Final = 9
METADATA_FILE: Final = "metadata.yaml"
INFORMATION: Final = "radarsim"  # name of the record of the conditions
LATCHED: Final = "transient_local"  # durability of topics
DISTRIBUTION: Final = "jazzy"  # of ROS, whose definitions of types are written
# In C where there is such: metadata of hundreds of topics would take seconds.
_DUMPER: Final = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
_UNLIMITED: Final = {"sec": 9223372036, "nsec": 854775807}
# Bytes; chunks have about 2**16. A length that is broken or made up must not make the
# reader ask for as much memory.
LARGEST_RECORD = 2**28
BROKEN = (
    McapError,
    CRCValidationError,
    ZstdError,
    zlib.error,
    struct.error,
    ValueError,
    OverflowError,  # of a length that is broken
    OSError,
)


def _quality_of_service(*, latched: bool) -> list[dict[str, object]]:
    """Return the quality of service of a topic, as rosbag2 writes it.

    No two values are one object: YAML would refer to it by an anchor, which rosbag2
    does not read.
    """
    return [
        {
            "history": "keep_last",
            "depth": 1 if latched else 10,
            "reliability": "reliable",
            "durability": LATCHED if latched else "volatile",
            "deadline": dict(_UNLIMITED),
            "lifespan": dict(_UNLIMITED),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_UNLIMITED),
            "avoid_ros_namespace_conventions": False,
        }
    ]


def _to_yaml(content: object) -> str:
    text: str = yaml.dump(content, Dumper=_DUMPER, sort_keys=False)
    return text


class BagMessage(NamedTuple):
    """A message of a bag.

    Attributes:
        topic: Name of its topic.
        type: Name of its type, such as ``sensor_msgs/msg/LaserScan``.
        data: The message in CDR.
        time: When it was recorded, ns.
        latched: Whether who subscribes later gets the last one of the topic.
    """

    topic: str
    type: str
    data: bytes
    time: int
    latched: bool = False


class BagWriter:
    """Writes one bag into its folder."""

    def __init__(
        self, folder: Path, information: Mapping[str, str], *, path: Path | None = None
    ) -> None:
        """Begin the file.

        Args:
            folder: The folder, which exists.
            information: What the bag is a recording of; see ``RecordingInfo``.
            path: File to write, which replaces that of the folder when it is complete;
                None for that of the folder itself.

        Raises:
            OSError: If the file cannot be written.
        """
        self._folder = folder
        self._path = path or folder / file_name(folder)
        self._channels: dict[str, int] = {}  # by topic
        self._schemas: dict[str, int] = {}  # by type
        self._counts: Counter[str] = Counter()
        self._flushed = 0
        self._file = self._path.open("wb")
        lock(self._file)
        self._writer: Any = Writer(  # some of its methods have no types
            self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD
        )
        self._writer.start(profile="ros2", library="radarsim")
        self._writer.add_metadata(INFORMATION, dict(information))
        self._file.flush()

    def write(self, message: BagMessage) -> None:
        """Write one message; all of a topic have the same type.

        Raises:
            OSError: If the file cannot be written.
        """
        topic, type_, data, time, latched = message
        if topic not in self._channels:
            self._add_topic(topic, type_, latched=latched)
        channel, number = self._channels[topic], self._counts[topic]
        # Log time and publish time are both simulated: the same run gives the same bag.
        self._writer.add_message(channel, time, data, time, sequence=number)
        self._counts[topic] += 1
        # By recorded time, not by that of the wall: a run gives the same bytes again.
        if time - self._flushed >= FLUSH_INTERVAL:
            self._writer.flush()
            self._flushed = time
        # What the writer has handed on is in the file, also if the process is killed.
        self._file.flush()

    def close(self) -> None:
        """Write the index and the metadata.

        Raises:
            OSError: If a file cannot be written.
        """
        try:
            self._writer.finish()
        finally:
            self._file.close()
        # Does nothing unless a repair writes next to the old file.
        path = self._path.replace(self._folder / file_name(self._folder))
        # Players read the topics from the metadata, not from the file.
        text = _to_yaml({"rosbag2_bagfile_information": _metadata_of(path)})
        write_atomically({self._folder / METADATA_FILE: text.encode()})

    def _add_topic(self, topic: str, type_: str, *, latched: bool) -> None:
        if type_ not in self._schemas:
            definition = definition_of(type_).encode()
            schema = self._writer.register_schema(type_, "ros2msg", definition)
            self._schemas[type_] = schema
        offered = _to_yaml(_quality_of_service(latched=latched))
        hash_ = typestore().hash_rihs01(type_)
        quality = {"offered_qos_profiles": offered, "topic_type_hash": hash_}
        schema = self._schemas[type_]
        self._channels[topic] = self._writer.register_channel(
            topic, "cdr", schema, quality
        )


def _metadata_of(path: Path) -> dict[str, object]:
    """Return the metadata of rosbag2 for a file that is complete."""
    with path.open("rb") as file:
        summary = SeekingReader(file).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    counts = summary.statistics
    start = {"nanoseconds_since_epoch": counts.message_start_time}
    length = max(0, counts.message_end_time - counts.message_start_time)
    return {
        "version": METADATA_VERSION,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": length},
        "starting_time": start,
        "message_count": counts.message_count,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": each.topic,
                    "type": summary.schemas[each.schema_id].name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": _quality_of_service(
                        latched=LATCHED in each.metadata["offered_qos_profiles"]
                    ),
                    "type_description_hash": each.metadata["topic_type_hash"],
                },
                "message_count": counts.channel_message_counts[each.id],
            }
            for each in summary.channels.values()
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [path.name],
        "files": [
            {
                "path": path.name,
                "starting_time": dict(start),
                "duration": {"nanoseconds": length},
                "message_count": counts.message_count,
            }
        ],
        "custom_data": None,
        "ros_distro": DISTRIBUTION,
    }


class BagReader:
    """Reads one bag of radarsim.

    Attributes:
        folder: Folder of the bag.
        path: Its file.
        info: The conditions of the recorded run.
        is_complete: Whether the file has its end; known once all messages are read.
    """

    def __init__(self, folder: Path) -> None:
        """Find the file, and read the conditions.

        Args:
            folder: Folder of the bag.

        Raises:
            RecordingError: If it is no recording of radarsim, or cannot be read.
        """
        self.folder = folder
        self.is_complete = False
        self.path = find_file(folder)
        with self.open() as file, suppress(*BROKEN):
            # The first record after the header.
            records = StreamReader(file, record_size_limit=LARGEST_RECORD).records
            _, record = next(records), next(records)
            if isinstance(record, Metadata) and record.name == INFORMATION:
                self.info = RecordingInfo.from_text(record.metadata)
                return
        raise RecordingError(f"{self.path}: expected a recording of radarsim")

    @property
    def is_being_written(self) -> bool:
        """Whether a process still records to the file."""
        with self.open() as file:
            return not lock(file, shared=True)

    def messages(self) -> Iterator[BagMessage]:
        """Yield all messages, as far as the file can be read.

        Raises:
            RecordingError: If the file cannot be opened.
        """
        with self.open() as file, suppress(*BROKEN):
            # What comes before an error is whole: each chunk has its own checksum.
            reader = NonSeekingReader(
                file, validate_crcs=True, record_size_limit=LARGEST_RECORD
            )
            # In the order of the file: to sort messages, all are kept in memory.
            for schema, channel, message in reader.iter_messages(log_time_order=False):
                quality = channel.metadata.get("offered_qos_profiles", "")
                yield BagMessage(
                    channel.topic,
                    schema.name if schema else "",
                    message.data,
                    message.log_time,
                    LATCHED in quality,
                )
            self.is_complete = True

    def calls(self) -> Iterator[RunEvent]:
        """Yield the calls of the host, in order.

        Raises:
            RecordingError: If the file cannot be read, or what it says of a call.
        """
        for message in self.messages():
            if message.topic in (TO_CLIENT, TO_SERVER):
                yield decode_call(message.type, message.data)

    def open(self) -> IO[bytes]:
        """Open its file.

        Raises:
            RecordingError: If it cannot be opened.
        """
        try:
            return self.path.open("rb")
        except OSError as error:
            raise RecordingError(f"{self.path}: {describe_os_error(error)}") from error


def decode_call(type_: str, message: bytes) -> RunEvent:
    """Decode a message of one of the topics of the wire.

    Raises:
        RecordingError: If it is no call of a host.
    """
    try:
        octets = decode(type_, message, UInt8MultiArray)
        name, client, tick = octets.layout.dim[0].label.split()
        data = octets.data.tobytes()
        return RunEvent(EventType[name.upper()], int(tick), int(client), data)
    except (LookupError, ValueError) as error:
        text = f"call {error}, expected one of radarsim"
        raise RecordingError(text) from error


def repair(folder: Path) -> int:
    """Rewrite the file of a bag with all messages that can be read.

    Args:
        folder: Folder of the bag, whose file may end in the middle.

    Returns:
        The number of messages.

    Raises:
        RecordingError: If it is no recording of radarsim, cannot be read, or is still
            being recorded.
        OSError: If it cannot be written; the bag is as it was then.
    """
    reader = BagReader(folder)
    if reader.is_being_written:
        text = f"{folder} is still being recorded, expected a run that has ended"
        raise RecordingError(text)
    # Next to the old file, which is replaced once all of the new one is written.
    part = folder / f".{file_name(folder)}.part"
    count = 0
    try:
        writer = BagWriter(folder.resolve(), reader.info.to_text(), path=part.resolve())
        for message in reader.messages():
            writer.write(message)
            count += 1
        writer.close()
    finally:
        part.unlink(missing_ok=True)
    if reader.path != folder / file_name(folder):  # of a folder that was renamed
        reader.path.unlink()
    return count
