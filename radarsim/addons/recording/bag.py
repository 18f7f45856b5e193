"""Writes and reads ROS 2 bags: a folder with an MCAP file and its metadata.

Every topic has the definition and the hash of its type, so that a bag can be read and
played without radarsim. Messages are grouped in chunks of 64 KiB or one second. A full
chunk is written to the file at once, so a process that is killed loses at most one
chunk. A truncated file is read up to its last whole record.

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
INFORMATION: Final = "radarsim"  # name of the metadata record with the conditions
LATCHED: Final = "transient_local"  # durability of latched topics
DISTRIBUTION: Final = "jazzy"  # ROS distribution of the type definitions
# The C dumper is used if available, because the Python dumper takes seconds for
# hundreds of topics.
_DUMPER: Final = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
_UNLIMITED: Final = {"sec": 9223372036, "nsec": 854775807}
# Most bytes of a record; a chunk has about 2**16 bytes. Without this limit, a damaged
# or forged length could make the reader allocate too much memory.
LARGEST_RECORD = 2**28
BROKEN = (
    McapError,
    CRCValidationError,
    ZstdError,
    zlib.error,
    struct.error,
    ValueError,
    OverflowError,  # raised for a damaged length
    OSError,
)


def _quality_of_service(*, latched: bool) -> list[dict[str, object]]:
    """Return the quality of service of a topic, as rosbag2 writes it.

    Each value is a separate object. YAML would write a shared object as an anchor,
    which rosbag2 cannot read.
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
        topic: Name of the topic.
        type: Name of the type, such as ``sensor_msgs/msg/LaserScan``.
        data: The message in CDR.
        time: Simulated time, ns.
        latched: Whether late subscribers get the last message of the topic.
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
        """Create the file.

        Args:
            folder: The folder, which exists.
            information: The conditions of the run; see ``RecordingInfo``.
            path: File to write; when complete, it replaces the file of the folder. None
                to write the file of the folder itself.

        Raises:
            OSError: If the file cannot be written.
        """
        self._folder = folder
        self._path = path or folder / file_name(folder)
        self._channels: dict[str, int] = {}  # channel ids, by topic
        self._schemas: dict[str, int] = {}  # schema ids, by type
        self._counts: Counter[str] = Counter()
        self._flushed = 0
        self._file = self._path.open("wb")
        lock(self._file)
        self._writer: Any = Writer(  # some methods lack type hints
            self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD
        )
        self._writer.start(profile="ros2", library="radarsim")
        self._writer.add_metadata(INFORMATION, dict(information))
        self._file.flush()

    def write(self, message: BagMessage) -> None:
        """Write one message; all messages of a topic have the same type.

        Raises:
            OSError: If the file cannot be written.
        """
        topic, type_, data, time, latched = message
        if topic not in self._channels:
            self._add_topic(topic, type_, latched=latched)
        channel, number = self._channels[topic], self._counts[topic]
        # The log time and the publish time are simulated times, so the same run gives
        # the same bag.
        self._writer.add_message(channel, time, data, time, sequence=number)
        self._counts[topic] += 1
        # A chunk ends after an interval of recorded time, not of wall time, so the same
        # run gives the same bytes.
        if time - self._flushed >= FLUSH_INTERVAL:
            self._writer.flush()
            self._flushed = time
        # Complete chunks are flushed to the file, so they survive if the process is
        # killed.
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
        # A repair writes to another path, which replaces the bag's file here. Without a
        # repair, both paths are the same.
        path = self._path.replace(self._folder / file_name(self._folder))
        # Players read the topics from the metadata, not from the MCAP file.
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
    """Return the rosbag2 metadata of a complete file."""
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
        path: The MCAP file.
        info: The conditions of the recorded run.
        is_complete: Whether the file is complete; set once all messages are read.
    """

    def __init__(self, folder: Path) -> None:
        """Find the file of the bag, and read the conditions of the recorded run.

        Args:
            folder: Folder of the bag.

        Raises:
            RecordingError: If the folder has no recording of radarsim, or its file
                cannot be read.
        """
        self.folder = folder
        self.is_complete = False
        self.path = find_file(folder)
        with self.open() as file, suppress(*BROKEN):
            # The conditions are in the first record after the header.
            records = StreamReader(file, record_size_limit=LARGEST_RECORD).records
            _, record = next(records), next(records)
            if isinstance(record, Metadata) and record.name == INFORMATION:
                self.info = RecordingInfo.from_text(record.metadata)
                return
        raise RecordingError(f"{self.path}: not a recording of radarsim")

    @property
    def is_being_written(self) -> bool:
        """Whether a process is still recording to the file."""
        with self.open() as file:
            return not lock(file, shared=True)

    def messages(self) -> Iterator[BagMessage]:
        """Yield the messages up to the end of the file or to the first damaged record.

        Raises:
            RecordingError: If the file cannot be opened.
        """
        with self.open() as file, suppress(*BROKEN):
            # Messages before an error are intact, as each chunk has a checksum.
            reader = NonSeekingReader(
                file, validate_crcs=True, record_size_limit=LARGEST_RECORD
            )
            # Messages keep the order of the file, because sorting needs all of them in
            # memory.
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
            RecordingError: If the file cannot be opened, or a call is malformed.
        """
        for message in self.messages():
            if message.topic in (TO_CLIENT, TO_SERVER):
                yield decode_call(message.type, message.data)

    def open(self) -> IO[bytes]:
        """Open the MCAP file.

        Raises:
            RecordingError: If the file cannot be opened.
        """
        try:
            return self.path.open("rb")
        except OSError as error:
            raise RecordingError(f"{self.path}: {describe_os_error(error)}") from error


def decode_call(type_: str, message: bytes) -> RunEvent:
    """Decode a message of ``/radarsim/wire/to_client`` or ``to_server``.

    Raises:
        RecordingError: If the message is no call of a host.
    """
    try:
        octets = decode(type_, message, UInt8MultiArray)
        name, client, tick = octets.layout.dim[0].label.split()
        data = octets.data.tobytes()
        return RunEvent(EventType[name.upper()], int(tick), int(client), data)
    except (LookupError, ValueError) as error:
        text = f"not a call that radarsim recorded: {error}"
        raise RecordingError(text) from error


def repair(folder: Path) -> int:
    """Rewrite the file of a bag with all messages that can be read.

    Args:
        folder: Folder of the bag, whose file may be truncated.

    Returns:
        The number of messages.

    Raises:
        RecordingError: If the folder has no recording of radarsim, or it cannot be
            read or is still being recorded.
        OSError: If the new file cannot be written; the bag stays unchanged then.
    """
    reader = BagReader(folder)
    if reader.is_being_written:
        text = f"{folder} is still being recorded, expected a run that has ended"
        raise RecordingError(text)
    # The new file is written next to the old one, and replaces it when complete.
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
    if reader.path != folder / file_name(folder):  # the folder was renamed
        reader.path.unlink()
    return count
