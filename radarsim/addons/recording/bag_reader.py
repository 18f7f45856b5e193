"""Read recordings, also those whose file ends in the middle of a record."""

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from mcap.exceptions import McapError
from mcap.records import (
    Channel,
    Footer,
    McapRecord,
    Message,
    Metadata,
    Schema,
)
from mcap.stream_reader import CRCValidationError, StreamReader
from zstandard import ZstdError

from radarsim.addons.recording.bag_folder import (
    RecordingInfo,
    file_name,
    find_file,
    is_being_written,
)
from radarsim.addons.recording.bag_writer import INFORMATION, BagWriter
from radarsim.addons.recording.call_converter import TO_CLIENT, TO_SERVER
from radarsim.addons.recording.cdr import EncodedMessage, UInt8MultiArray, decode
from radarsim.addons.recording.host_recorder import EventType, RunEvent
from radarsim.errors import RecordingError

# Bytes; chunks have about 2**16. A length that is broken or made up must not make the
# reader ask for as much memory.
LARGEST_RECORD = 2**28
_BROKEN = (
    McapError,
    CRCValidationError,
    ZstdError,
    zlib.error,
    struct.error,
    ValueError,
)


class BagMessage(NamedTuple):
    """A message of a bag.

    Attributes:
        topic: Name of its topic.
        message: The message.
        time: When it was recorded, ns.
        latched: Whether who subscribes later gets the last one of the topic.
    """

    topic: str
    message: EncodedMessage
    time: int
    latched: bool


class BagReader:
    """Reads one bag of radarsim.

    Attributes:
        folder: Folder of the bag.
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
        self._path = find_file(folder)
        for record in self._records():
            if isinstance(record, Metadata) and record.name == INFORMATION:
                self.info = RecordingInfo.from_text(record.metadata)
                return
            if isinstance(record, Message):
                break
        raise RecordingError(f"{self._path}: expected a recording of radarsim")

    @property
    def path(self) -> Path:
        """The file."""
        return self._path

    @property
    def is_being_written(self) -> bool:
        """Whether a process still records to the file."""
        return is_being_written(self._path)

    def messages(self) -> Iterator[BagMessage]:
        """Yield all messages, as far as the file can be read.

        Raises:
            RecordingError: If the file cannot be read at all.
        """
        channels: dict[int, tuple[str, str, bool]] = {}
        schemas: dict[int, str] = {}
        for record in self._records():
            match record:
                case Schema(id=number, name=name):
                    schemas[number] = name
                case Channel(
                    id=number, topic=topic, schema_id=schema, metadata=quality
                ):
                    latched = "transient_local" in quality.get(
                        "offered_qos_profiles", ""
                    )
                    channels[number] = topic, schemas[schema], latched
                case Message(channel_id=number, log_time=time, data=data):
                    topic, type_, latched = channels[number]
                    yield BagMessage(topic, EncodedMessage(type_, data), time, latched)
                case Footer():
                    self.is_complete = True
                case _:
                    pass

    def calls(self) -> Iterator[RunEvent]:
        """Yield the calls of the host, in order.

        Raises:
            RecordingError: If the file cannot be read, or what it says of a call.
        """
        for topic, message, _, _ in self.messages():
            if topic in (TO_CLIENT, TO_SERVER):
                yield _call(message)

    def _records(self) -> Iterator[McapRecord]:
        """Yield the records of the file up to the first that is not whole."""
        try:
            with self._path.open("rb") as file:
                reader = StreamReader(
                    file, validate_crcs=True, record_size_limit=LARGEST_RECORD
                )
                try:
                    yield from reader.records
                except _BROKEN:
                    return
        except OSError as error:
            raise RecordingError(f"{self._path}: {error.strerror}") from error


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
        for topic, message, time, latched in reader.messages():
            writer.write(topic, message, time, latched=latched)
            count += 1
        writer.close()
    finally:
        part.unlink(missing_ok=True)
    if reader.path != folder / file_name(folder):  # of a folder that was renamed
        reader.path.unlink()
    return count


def _call(message: EncodedMessage) -> RunEvent:
    """Read a call from its message.

    Raises:
        RecordingError: If it is not readable.
    """
    try:
        octets = decode(message, UInt8MultiArray)
        name, client, tick = octets.layout.dim[0].label.split()
        data = octets.data.tobytes()
        return RunEvent(EventType[name.upper()], int(tick), int(client), data)
    except (LookupError, ValueError) as error:
        raise RecordingError(f"call {error}, expected one of radarsim") from error
