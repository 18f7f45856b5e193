"""``--record`` of commands that drive a robot, or follow one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Final, Self, TypeAlias

from radarsim import __version__
from radarsim.cli.options import DriveUnit
from radarsim.cli.output import print_message
from radarsim.errors import RecordingError

if TYPE_CHECKING:
    from radarsim.addons.recording.bag_folder import RecordingInfo
    from radarsim.addons.recording.recording_process import RecordingProcess
    from radarsim.addons.recording.wire_recorder import WireRecorder
    from radarsim.autonomy.mapping.mapper import Mapper
    from radarsim.autonomy.proxy.tcp_proxy import DataCallback
    from radarsim.client import Client
    from radarsim.server.host import Host
    from radarsim.server.host.recorded_host import HostCall

ItemSettings: TypeAlias = Mapping[str, Mapping[str, Any]]  # by items and keys

MAP_INTERVAL: Final = 1.0  # s between messages of a map


class RunRecording:
    """The recording of one run; without a folder nothing is recorded.

    The run is that of a host in this process, whose recording can be verified, or what
    passes between clients and a server that is another program. It is a context: the
    folder is created when it is entered, and the recording is complete when it is left.
    """

    def __init__(self, folder: Path | None, drive_unit: DriveUnit) -> None:
        """Check that it can be recorded.

        Args:
            folder: Folder to create; None for no recording.
            drive_unit: Unit of the commands to drive.

        Raises:
            RecordingError: If the folder exists, or a package is missing.
        """
        self.folder = folder
        self._drive_unit = drive_unit
        self._host: Host | None = None
        self._wire: WireRecorder | None = None
        self._info: RecordingInfo | None = None
        self._process: RecordingProcess | None = None
        self._early: list[HostCall] = []  # before the process has been started
        self._map_due = -math.inf
        if folder is not None:
            from radarsim.addons.recording.bag_folder import check_installed

            check_installed()
            if folder.exists():
                text = f"{folder} exists, expected a new folder for the recording"
                raise RecordingError(text)

    def load_host(
        self, map_: str | None, *, seed: int | None, settings: ItemSettings
    ) -> Host | None:
        """Create the host of the map that is given, if one is.

        Raises:
            MapError: If the map is wrong.
            typer.BadParameter: If a setting of an item is wrong.
        """
        from radarsim.cli.recorded_host import describe
        from radarsim.cli.serve import load_served_host

        host = load_served_host(
            map_,
            seed=seed,
            settings=settings,
            drive_unit=self._drive_unit,
            record=None if self.folder is None else self._add,
        )
        if host is not None and map_ is not None:
            self._host = host
            self._info = describe(map_, host.scene, host.config, seed or 0)
        return host

    def connect(self, host: str, port: int) -> Client:
        """Connect to a server over TCP, and record what passes.

        Raises:
            ClientError: If the connection cannot be opened.
        """
        from radarsim.addons.recording.wire_recorder import RecordedTransport
        from radarsim.client import Client
        from radarsim.client.transport import SocketTransport

        transport = SocketTransport(host, port)
        if self._wire is None:
            return Client(transport)
        return Client(RecordedTransport(transport, self._wire))

    def follow(self, robot: str = "") -> DataCallback | None:
        """Return what records the connections of others; None without a recording.

        Args:
            robot: Name of the robot, if it is not in what its client sends.
        """
        from radarsim.addons.recording.wire_recorder import FIRST

        wire = self._wire
        if wire is None:
            return None
        if robot:
            wire.begin(FIRST, robot)

        def record(number: int, side: str, data: bytes) -> None:
            (wire.sent if side == "client" else wire.received)(number, data)

        return record

    def add_map(self, mapper: Mapper | None, *, last: bool = False) -> None:
        """Record a map, at most once a second.

        Args:
            mapper: Holds the map; None if there is none.
            last: Whether it is complete, and recorded in any case.
        """
        if self._process is None or mapper is None or not mapper.scans:
            return
        time = mapper.trajectory.times[-1]
        if time < self._map_due and not last:
            return
        from radarsim.addons.recording.call_converter import pack_message
        from radarsim.addons.recording.robot_topics import map_message
        from radarsim.server.host.recorded_host import CallKind, HostCall

        self._map_due = time + MAP_INTERVAL
        data = pack_message(map_message(mapper.grid, time))
        self._add(HostCall(CallKind.MESSAGE, round(100 * time), 0, data))

    def __enter__(self) -> Self:
        """Create the folder, and begin to record."""
        if self.folder is None:
            return self
        from radarsim.addons.recording.bag_folder import RecordingInfo, create_folder
        from radarsim.addons.recording.recording_process import RecordingProcess
        from radarsim.addons.recording.wire_recorder import WireRecorder

        unit: Any = self._drive_unit.value  # one of its literals
        info = self._info or RecordingInfo(version=__version__, drive_unit=unit)
        create_folder(self.folder)
        is_patient = self._host is not None  # simulated time waits as well
        self._process = RecordingProcess(self.folder, info, is_patient=is_patient)
        for call in self._early:
            self._process.add(call)
        if self._host is None:
            self._wire = WireRecorder(self._add)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Complete the recording."""
        if self._process is None:
            return
        from radarsim.server.host.recorded_host import RecordedHost

        if isinstance(self._host, RecordedHost):
            self._host.end_recording()
        if self._wire is not None:
            self._wire.end()
        if self._process.close():
            print_message(f"recorded in {self.folder}")

    def _add(self, call: HostCall) -> None:
        if self._process is None:
            self._early.append(call)
        else:
            self._process.add(call)
