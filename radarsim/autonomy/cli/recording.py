"""What records a run: nothing, or what the add-on for recordings has."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final, Self

from radarsim import plugins

if TYPE_CHECKING:
    from radarsim.autonomy.mapping.mapper import Mapper
    from radarsim.autonomy.watching import DataCallback
    from radarsim.client import Client
    from radarsim.protocol.dialect import DriveUnit
    from radarsim.server.host import Host

GROUP: Final = "radarsim.runs"  # of entries


class Recording:
    """Records nothing; what records overrides all methods."""

    def attach(self, host: Host, map_: str) -> None:
        """Record what is done to a host in this process, whose map has this name."""

    def connect(self, host: str, port: int) -> Client:
        """Connect to a server over TCP, and record what passes.

        Raises:
            ClientError: If the connection cannot be opened.
        """
        from radarsim.client import Client

        return Client.connect(host, port)

    def follow(self, robot: str) -> DataCallback:  # noqa: ARG002 - nothing is recorded
        """Return what records the reports of a robot of another client, by its name."""
        return lambda *_: None

    def add_map(self, mapper: Mapper | None, *, last: bool = False) -> None:
        """Record a map, at most once a second.

        Args:
            mapper: Holds the map; None if there is none.
            last: Whether it is complete, and recorded in any case.
        """

    def __enter__(self) -> Self:
        """Begin to record."""
        return self

    def __exit__(self, *_: object) -> None:
        """Complete the recording."""


def make_recording(
    folder: Path | None, drive_unit: DriveUnit, *, robots_map: bool = False
) -> Recording:
    """Return the recording of a run.

    Args:
        folder: Folder to create; None for no recording.
        drive_unit: Unit of the commands to drive.
        robots_map: Whether robots make a map, which ``add_map`` records.

    Raises:
        RecordingError: If the folder exists, or a package is missing.
        MissingPackage: If the add-on is not installed.
    """
    if folder is None:
        return Recording()
    record = plugins.load(GROUP, "record")
    recording: Recording = record(folder, drive_unit, robots_map=robots_map)
    return recording
