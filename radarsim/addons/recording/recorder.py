"""Writes a run to a bag."""

from pathlib import Path

from radarsim.addons.recording.bag_folder import RecordingInfo
from radarsim.addons.recording.bag_writer import BagWriter
from radarsim.addons.recording.call_converter import CallConverter
from radarsim.addons.recording.host_recorder import RunEvent
from radarsim.protocol.dialect import get_dialect


class Recorder:
    """Records one run.

    Attributes:
        folder: Folder of the recording.
        events: Number of events so far.
    """

    def __init__(self, folder: Path, info: RecordingInfo) -> None:
        """Begin a recording.

        Args:
            folder: Folder of the recording, which exists; see ``create_folder``.
            info: The conditions of the run.

        Raises:
            OSError: If the file cannot be written.
        """
        self.folder = folder
        self.events = 0
        self._converter = CallConverter(get_dialect(info.dialect), info.drive_unit)
        self._writer = BagWriter(folder, info.to_text())

    def add(self, event: RunEvent) -> None:
        """Write the messages that an event becomes.

        Raises:
            OSError: If the file cannot be written.
        """
        self.events += 1
        for time, message in self._converter.convert(event):
            self._writer.write(
                message.topic, message.message, time, latched=message.latched
            )

    def close(self) -> None:
        """Write the index; the recording is complete.

        Raises:
            OSError: If a file cannot be written.
        """
        self._writer.close()
