"""Read recordings, also those whose file ends in the middle of a record."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader
from mcap.records import Channel, Header, Message, Metadata, Schema
from mcap.stream_reader import StreamReader

from radarsim.errors import RecordingError
from radarsim.host.recorded_host import CallKind, HostCall
from radarsim.recording.bag_writer import METADATA_FILE
from radarsim.recording.call_converter import TO_CLIENT, TO_SERVER
from radarsim.recording.messages import read_octets
from radarsim.recording.recording_info import RecordingInfo
