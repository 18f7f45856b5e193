"""Bags of ROS 2: a folder with an MCAP file and its metadata, written and read.

Every topic has the definition and the hash of its type, so that a bag can be read and
played without radarsim. Messages are kept in chunks of 64 KiB or a second, each of
which goes to the file at once when it is full: a process that is killed loses at most
one. A file that ends in the middle of a record is read up to there.

Source: the MCAP specification and its profile ``ros2``; metadata of rosbag2, version 9.
"""

import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

import yaml
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader
from mcap.records import Metadata
from mcap.stream_reader import CRCValidationError, StreamReader
from mcap.writer import CompressionType, Writer
from zstandard import ZstdError

from radarsim.addons.recording.bag_folder import (
    RecordingInfo,
    file_name,
    find_file,
    is_being_written,
    lock,
)
from radarsim.addons.recording.call_converter import TO_CLIENT, TO_SERVER
from radarsim.addons.recording.cdr import (
    UInt8MultiArray,
    decode,
    definition_of,
    typestore,
)
from radarsim.addons.recording.host_recorder import EventType, RunEvent
from radarsim.errors import RecordingError, describe_os_error
from radarsim.files import write_atomically

CHUNK_BYTES: Final = 64 * 1024
FLUSH_INTERVAL: Final = 1_000_000_000  # ns of recorded time
METADATA_VERSION: Final = 9
METADATA_FILE: Final = "metadata.yaml"
INFORMATION: Final = "radarsim"  # name of the record that tells the conditions
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
)


def _quality_of_service(*, latched: bool) -> list[dict[str, object]]:
    """Return what a topic offers, as rosbag2 writes it.

    No two values are one object: YAML would refer to it by an anchor, which rosbag2
    does not read.
    """
    return [
        {
            "history": "keep_last",
            "depth": 1 if latched else 10,
            "reliability": "reliable",
            "durability": "transient_local" if latched else "volatile",
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


@dataclass(slots=True)
class _Topic:
    channel: int
    type: str
    digest: str
    latched: bool
    messages: int = 0


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
        self._topics: dict[str, _Topic] = {}
        self._schemas: dict[str, tuple[int, str]] = {}  # numbers and hashes of types
        self._first: int | None = None
        self._last = 0
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
        entry = self._topics.get(topic)
        if entry is None:
            entry = self._add_topic(topic, type_, latched=latched)
        # Log time and publish time are both simulated: the same run gives the same bag.
        self._writer.add_message(
            entry.channel, time, data, time, sequence=entry.messages
        )
        entry.messages += 1
        # By recorded time, not by that of the wall: a run gives the same bytes again.
        if time - self._flushed >= FLUSH_INTERVAL:
            self._writer.flush()
            self._flushed = time
        # What the writer has handed on is in the file, also if the process is killed.
        self._file.flush()
        self._first = time if self._first is None else min(self._first, time)
        self._last = max(self._last, time)

    def close(self) -> None:
        """Write the index and the metadata.

        Raises:
            OSError: If a file cannot be written.
        """
        try:
            self._writer.finish()
        finally:
            self._file.close()
        # Does nothing unless a repair writes beside the old file.
        self._path.replace(self._folder / file_name(self._folder))
        # Players read the metadata, not the file, to know what is in it.
        first = self._first or 0
        length = max(0, self._last - first)
        count = sum(topic.messages for topic in self._topics.values())
        information = {
            "version": METADATA_VERSION,
            "storage_identifier": "mcap",
            "duration": {"nanoseconds": length},
            "starting_time": {"nanoseconds_since_epoch": first},
            "message_count": count,
            "topics_with_message_count": [
                {
                    "topic_metadata": {
                        "name": name,
                        "type": topic.type,
                        "serialization_format": "cdr",
                        "offered_qos_profiles": _quality_of_service(
                            latched=topic.latched
                        ),
                        "type_description_hash": topic.digest,
                    },
                    "message_count": topic.messages,
                }
                for name, topic in self._topics.items()
            ],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [file_name(self._folder)],
            "files": [
                {
                    "path": file_name(self._folder),
                    "starting_time": {"nanoseconds_since_epoch": first},
                    "duration": {"nanoseconds": length},
                    "message_count": count,
                }
            ],
            "custom_data": None,
            "ros_distro": DISTRIBUTION,
        }
        text = _to_yaml({"rosbag2_bagfile_information": information})
        write_atomically({self._folder / METADATA_FILE: text.encode()})

    def _add_topic(self, name: str, type_: str, *, latched: bool) -> _Topic:
        if type_ not in self._schemas:
            definition = definition_of(type_).encode()
            schema = self._writer.register_schema(type_, "ros2msg", definition)
            self._schemas[type_] = schema, typestore().hash_rihs01(type_)
        schema, digest = self._schemas[type_]
        offered = _to_yaml(_quality_of_service(latched=latched))
        channel = self._writer.register_channel(
            name,
            "cdr",
            schema,
            {"offered_qos_profiles": offered, "topic_type_hash": digest},
        )
        topic = self._topics[name] = _Topic(channel, type_, digest, latched)
        return topic


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
        with self._open() as file, suppress(*BROKEN):
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
        return is_being_written(self.path)

    def messages(self) -> Iterator[BagMessage]:
        """Yield all messages, as far as the file can be read.

        Raises:
            RecordingError: If the file cannot be read at all.
        """
        with self._open() as file, suppress(*BROKEN):
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
                    "transient_local" in quality,
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

    @contextmanager
    def _open(self) -> Iterator[IO[bytes]]:
        try:
            with self.path.open("rb") as file:
                yield file
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
    """Write the file of a bag anew, with all messages that can be read.

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
    # Beside the old file, which is replaced once all of the new one is written.
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
