"""Implements the option ``--record`` of commands that serve, drive or follow robots."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Self

from annotated_types import Interval

from radarsim import __version__
from radarsim.autonomy.cli.run_files import Recording
from radarsim.cli.output import print_message
from radarsim.cli.server_options import ServedMap, ServeExtension
from radarsim.plans import Option
from radarsim.protocol.dialect import DriveUnit

if TYPE_CHECKING:
    from radarsim.addons.recording.recorders import WireRecorder
    from radarsim.addons.recording.recording_process import RecordingProcess
    from radarsim.autonomy.mapping.mapper import Mapper
    from radarsim.autonomy.watching import DataCallback, Side
    from radarsim.client import Client
    from radarsim.server.host import Host

MAP_INTERVAL: Final = 1.0  # s between two recorded maps


@dataclass(frozen=True, slots=True)
class RecordOptions:
    """Options of ``radarsim serve`` for recordings.

    Attributes:
        record: Record the run in a new folder, as a ROS 2 bag that 'radarsim replay'
            can repeat. Needs the extra 'record'.
        record_spectra: Also record the spectra of FMCW radars, some 180 MB per minute.
        record_own_localization: Omit the transform from map to odom, for programs that
            localise the robot while the bag is played.
        record_no_namespace: Name topics and frames of this robot without the robot's
            name, such as /odom and base_link.
        record_camera: Also record pictures of the first robot's camera, at this rate in
            simulated time.
    """

    option_group: ClassVar = "Additional services"

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
    """Records a run of ``radarsim serve``."""

    def __init__(self, options: RecordOptions, folder: Path, served: ServedMap) -> None:
        """Store the options; ``attach`` starts the recording."""
        self._options = options
        self._folder = folder
        self._served = served
        self._process: RecordingProcess | None = None

    def open(self) -> None:
        """Check that the folder can be created."""
        from radarsim.addons.recording.bag_folder import check_new

        check_new(self._folder)

    def attach(self, host: Host) -> None:
        """Record the calls of a host from now on."""
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
        """Complete the recording, if it has started."""
        if self._process is not None and self._process.close():
            print_message(f"recorded in {self._folder}")


class RunRecording(Recording):
    """Records one run: the calls of a host in this process, or bytes on connections.

    A recording of a host can be verified. With a server in another program, the bytes
    between its clients and the server are recorded. The folder is created when the
    context manager is entered.
    """

    def __init__(
        self, folder: Path, drive_unit: DriveUnit, *, robots_map: bool
    ) -> None:
        """Check that the folder can be created; see ``make_recording``."""
        from radarsim.addons.recording.bag_folder import check_new

        self._folder, self._drive_unit = folder, drive_unit
        self._robots_map = robots_map
        self._hosted: tuple[str, Host, int] | None = None  # map, host and seed
        self._process: RecordingProcess
        self._wire: WireRecorder | None = None  # for a server in another program
        self._map_due = -math.inf
        check_new(folder)

    def attach(self, host: Host, map_: str) -> None:
        """See ``Recording.attach``."""
        self._hosted = map_, host, host.simulation.seed

    def connect(self, host: str, port: int) -> Client:
        """See ``Recording.connect``."""
        from radarsim.addons.recording.recorders import RecordedTransport
        from radarsim.client import Client

        assert self._wire is not None  # a host in this process has no connections
        return Client(RecordedTransport(host, port, self._wire))

    def follow(self, robot: str) -> DataCallback:
        """See ``Recording.follow``."""
        from radarsim.addons.recording.recorders import FIRST

        wire = self._wire
        assert wire is not None
        wire.begin(FIRST, robot)

        def record(side: Side, data: bytes) -> None:
            (wire.sent if side == "client" else wire.received)(FIRST, data)

        return record

    def add_map(self, mapper: Mapper | None, *, last: bool = False) -> None:
        """See ``Recording.add_map``."""
        if mapper is None or not mapper.scans:
            return
        time = mapper.trajectory.times[-1]
        # Recording a map with every scan would take up most of the file, so maps are
        # recorded at intervals. The last map is always recorded.
        if time < self._map_due and not last:
            return
        from radarsim.addons.recording.recorders import EventType, RunEvent, pack
        from radarsim.addons.recording.robot_topics import sensed_map

        self._map_due = time + MAP_INTERVAL
        data = pack(time, *sensed_map(mapper.grid))
        self._process.add(RunEvent(EventType.MAP, round(100 * time), 0, data))

    def __enter__(self) -> Self:
        """Create the folder, and start to record."""
        from radarsim.addons.recording.bag_folder import RecordingInfo
        from radarsim.addons.recording.recorders import WireRecorder
        from radarsim.addons.recording.recording_process import RecordingProcess

        if self._hosted is None:
            info = RecordingInfo(version=__version__, drive_unit=self._drive_unit)
            self._process = RecordingProcess(self._folder, info)
            self._wire = WireRecorder(self._process.add)
        else:
            info = RecordingInfo.of_host(*self._hosted, robots_map=self._robots_map)
            # The simulation waits if the recording process cannot keep up.
            self._process = RecordingProcess(self._folder, info, is_patient=True)
            self._process.record(self._hosted[1])
        return self

    def __exit__(self, *_: object) -> None:
        """Complete the recording."""
        if self._wire is not None:
            self._wire.end()
        if self._process.close():
            print_message(f"recorded in {self._folder}")
