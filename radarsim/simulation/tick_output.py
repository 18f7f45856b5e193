"""What comes out of one tick: reports of robots, and errors of single ones."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, ParamSpec, Protocol, TypeVar

from radarsim.geometry import Floats
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.protocol.fields import ReportGroup, SensorReport
from radarsim.protocol.reports import RangeScan, Status
from radarsim.raycast.rays import Boxes
from radarsim.sensors.scan import Echoes
from radarsim.simulation.vehicle import Vehicle

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class ScanEchoes:
    """The echoes of one scan.

    Attributes:
        scanner: Name of the scanner item.
        echoes: All echoes of the scan.
        is_requested: Whether the robot's client asked for them, and not only watchers.
    """

    scanner: str
    echoes: Echoes
    is_requested: bool


class TickOutput(NamedTuple):
    """The reports of one robot in one tick.

    Attributes:
        group: The status, if it is due, and readings of items that cast no rays.
        numbers: The numbers of these.
        cast: Readings of sonars and GPS.
        echoes: What belongs to scans, of scanners that list it.
        scans: Scans.
    """

    group: ReportGroup
    numbers: Sequence[float]
    cast: Sequence[SensorReport]
    echoes: "Sequence[ScanEchoes | DueScan]"
    scans: Sequence[RangeScan]

    @property
    def has_status(self) -> bool:
        """Whether the status is due, which is the first of the group."""
        samples = self.group.samples
        return bool(samples) and isinstance(samples[0], Status)


class Faults:
    """The robots in which something has failed, which only a bug can cause.

    Attributes:
        errors: The errors by the robot's number; whoever steps the simulation raises
            them, or removes these robots.
    """

    def __init__(self) -> None:
        self.errors: dict[int, Exception] = {}

    def call(
        self,
        vehicle: Vehicle,
        function: Callable[Arguments, Result],
        *args: Arguments.args,
        **kwargs: Arguments.kwargs,
    ) -> Result | None:
        """Call a function for a robot; keep its error and return None if it fails."""
        try:
            return function(*args, **kwargs)
        except Exception as error:  # noqa: BLE001 - a bug of one robot ends no other
            self.errors[vehicle.number] = error
            return None


class DueScan(NamedTuple):
    """What a scanner of an add-on reads in a tick.

    Attributes:
        vehicle: The robot that carries it.
        scan: The reading.
        reports: What belongs to it, such as targets, which come before the scan; empty
            if nobody gets that.
        is_requested: As of ``ScanEchoes``.
    """

    vehicle: Vehicle
    scan: RangeScan
    reports: Sequence[SensorReport] = ()
    is_requested: bool = False


class ScannerItems(Protocol):
    """Those scanners of all robots that an add-on reads, at times of its own.

    There is one for each add-on in the group ``radarsim.items`` of ``plugins``, made
    from the scene and the clock of a simulation.
    """

    def add(self, vehicle: Vehicle) -> None:
        """Read those scanners of a robot from now on that are of this kind."""

    def remove(self, vehicle: Vehicle) -> None:
        """Read those of a robot no more."""

    def read_due(
        self, find_boxes: Callable[[], Boxes], faults: Faults
    ) -> Sequence[DueScan]:
        """Pass a tick, and return the readings that are due in it.

        Args:
            find_boxes: Returns the robots.
            faults: For errors of single robots.
        """
        ...


def report_scan(
    time: float, name: str, settings: SensorSettings, ranges: Floats
) -> RangeScan:
    """Return what a scanner reports.

    Args:
        time: s.
        name: Name of the item.
        settings: Settings of the scanner.
        ranges: (N,) m; the maximum range where nothing came back.
    """
    resolution, fov = math.radians(settings.resolution_deg), settings.fov_deg
    return RangeScan(time, name, resolution, math.radians(fov), ranges)
