"""``--record`` of commands that serve, drive a robot, or follow one."""

from __future__ import annotations

import math
import pickle
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Self, TypeAlias

from annotated_types import Interval

from radarsim import __version__
from radarsim.cli.output import print_message
from radarsim.cli.server_options import ServedMap, ServeExtension
from radarsim.errors import RecordingError
from radarsim.plans import Option
from radarsim.protocol.dialect import DriveUnit

if TYPE_CHECKING:
    from radarsim.addons.recording.bag_folder import RecordingInfo
    from radarsim.addons.recording.recording_process import RecordingProcess
    from radarsim.addons.recording.wire_recorder import WireRecorder
    from radarsim.autonomy.mapping.mapper import Mapper
    from radarsim.autonomy.watching import DataCallback, Side
    from radarsim.client import Client
    from radarsim.server.host import Host

ItemSettings: TypeAlias = Mapping[str, Mapping[str, Any]]  # by items and keys

MAP_INTERVAL: Final = 1.0  # s between messages of a map


@dataclass(frozen=True, slots=True)
class RecordOptions:
    """Options of ``radarsim serve``.

    Attributes:
        record: Record the run in a new folder, as a bag of ROS 2 that 'radarsim replay'
            repeats. Needs the extra 'record'.
        record_spectra: Record what FMCW radars receive as well, some 180 MB a minute.
        record_own_localization: Leave the transform from map to odom out, for programs
            that localise the robot when the bag is played.
        record_no_namespace: Leave the name of this robot out of its topics and frames,
            as in /odom and base_link.
        record_camera: Record so many pictures of the first robot's camera in a second
            of simulated time.
    """

    option_group: ClassVar = "Beside the server"

    record: Annotated[Path | None, Option(metavar="DIR")] = None
    record_spectra: Annotated[bool, Option(is_rare=True, needs=("record",))] = False
    record_own_localization: Annotated[
        bool, Option(is_rare=True, needs=("record",))
    ] = False
    record_no_namespace: Annotated[
        str | None, Option(metavar="ROBOT", is_rare=True, needs=("record",))
    ] = None
    record_camera: Annotated[
        float | None,
        Interval(gt=0, le=50),
        Option(metavar="HZ", is_rare=True, needs=("record",)),
    ] = None

    def extension(self, served: ServedMap) -> ServeRecording | None:
        """See ``ExtensionOptions.extension``."""
        if self.record is None:
            return None
        return ServeRecording(self, self.record, served)


class ServeRecording(ServeExtension):
    """The recording of what is done to a server's host."""

    def __init__(self, options: RecordOptions, folder: Path, served: ServedMap) -> None:
        """Plan a recording; see ``RecordOptions``."""
        self._options = options
        self._folder = folder
        self._served = served
        self._has_folder = False
        self._process: RecordingProcess | None = None

    def open(self) -> None:
        """Create the folder."""
        from radarsim.addons.recording.bag_folder import check_installed, create_folder

        check_installed()
        create_folder(self._folder)
        self._has_folder = True

    def attach(self, host: Host) -> None:
        """Record from now on."""
        from radarsim.addons.recording.bag_folder import RecordingInfo
        from radarsim.addons.recording.recording_process import RecordingProcess

        options = self._options
        info = RecordingInfo.of_host(
            self._served.map,
            host,
            self._served.seed,
            own_localization=options.record_own_localization,
            no_namespace=options.record_no_namespace or "",
        )
        self._process = RecordingProcess(self._folder, info)
        rate = options.record_camera
        self._process.record(
            host,
            spectra=options.record_spectra,
            camera_interval=0 if rate is None else max(1, round(100 / rate)),
        )

    def close(self) -> None:
        """Complete the recording; of one that never began, nothing is left."""
        if self._process is not None:
            if self._process.close():
                print_message(f"recorded in {self._folder}")
        elif self._has_folder:
            # Only a folder in which nothing is written goes; a user may have put files
            # there.
            with suppress(OSError):
                self._folder.rmdir()


class RunRecording:
    """The recording of one run; without a folder nothing is recorded.

    The run is that of a host in this process, whose recording can be verified, or what
    passes between clients and a server that is another program. It is a context: the
    folder is created when it is entered, and the recording is complete when it is left.
    """

    def __init__(
        self, folder: Path | None, drive_unit: DriveUnit, *, robots_map: bool = False
    ) -> None:
        """Check that it can be recorded.

        Args:
            folder: Folder to create; None for no recording.
            drive_unit: Unit of the commands to drive.
            robots_map: Whether robots make a map, which ``add_map`` records.

        Raises:
            RecordingError: If the folder exists, or a package is missing.
        """
        self.folder = folder
        self._drive_unit = drive_unit
        self._robots_map = robots_map
        self._host: Host | None = None
        self._info: RecordingInfo | None = None
        self._process: RecordingProcess | None = None
        self._wire: WireRecorder | None = None  # of a server that is another program
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
            click.BadParameter: If a setting of an item is wrong.
        """
        from radarsim.cli.server_options import load_host
        from radarsim.simulation.config import SimulationConfig

        if map_ is None:
            return None
        config = SimulationConfig(drive_unit=self._drive_unit, item_settings=settings)
        host = load_host(map_, config, seed=seed or 0)
        if self.folder is not None:
            from radarsim.addons.recording.bag_folder import RecordingInfo

            self._host = host
            self._info = RecordingInfo.of_host(
                map_, host, seed or 0, robots_map=self._robots_map
            )
        return host

    def connect(self, host: str, port: int) -> Client:
        """Connect to a server over TCP, and record what passes.

        Raises:
            ClientError: If the connection cannot be opened.
        """
        from radarsim.addons.recording.wire_recorder import RecordedTransport
        from radarsim.client import Client

        if self._wire is None:
            return Client.connect(host, port)
        return Client(RecordedTransport(host, port, self._wire))

    def follow(self, robot: str) -> DataCallback:
        """Return what records the reports of a robot of another client.

        Args:
            robot: Name of the robot.
        """
        from radarsim.addons.recording.wire_recorder import FIRST

        wire = self._wire
        if wire is None:
            return lambda *_: None
        wire.begin(FIRST, robot)

        def record(side: Side, data: bytes) -> None:
            (wire.sent if side == "client" else wire.received)(FIRST, data)

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
        # A map at each scan would be most of a recording; the last one counts in any
        # case.
        if time < self._map_due and not last:
            return
        from radarsim.addons.recording.host_recorder import EventType, RunEvent
        from radarsim.addons.recording.robot_topics import sensed_map

        self._map_due = time + MAP_INTERVAL
        data = pickle.dumps(sensed_map(mapper.grid, time))
        self._process.add(RunEvent(EventType.MAP, round(100 * time), 0, data))

    def __enter__(self) -> Self:
        """Create the folder, and begin to record."""
        if self.folder is None:
            return self
        from radarsim.addons.recording.bag_folder import RecordingInfo, create_folder
        from radarsim.addons.recording.recording_process import RecordingProcess
        from radarsim.addons.recording.wire_recorder import WireRecorder

        unit, host = self._drive_unit, self._host
        info = self._info or RecordingInfo(version=__version__, drive_unit=unit)
        create_folder(self.folder)
        is_patient = host is not None  # simulated time waits as well
        self._process = RecordingProcess(self.folder, info, is_patient=is_patient)
        if host is None:
            self._wire = WireRecorder(self._process.add)
        else:
            self._process.record(host)
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
        if self._wire is not None:
            self._wire.end()
        if self._process.close():
            print_message(f"recorded in {self.folder}")
