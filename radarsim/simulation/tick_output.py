"""The output of one tick: reports of robots, and the errors that robots raised."""

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
        is_requested: Whether the robot's client requested them, not only watchers.
    """

    scanner: str
    echoes: Echoes
    is_requested: bool


class TickOutput(NamedTuple):
    """The reports of one robot in one tick.

    Attributes:
        group: Templates of the status, if due, and of readings without rays.
        numbers: The numbers that fill these templates.
        cast: Readings of sensors with rays, such as sonars and GPS.
        echoes: Echoes or targets of the scans, if they are requested or watched.
        scans: The scans of range scanners.
    """

    group: ReportGroup
    numbers: Sequence[float]
    cast: Sequence[SensorReport]
    echoes: "Sequence[ScanEchoes | DueScan]"
    scans: Sequence[RangeScan]

    @property
    def has_status(self) -> bool:
        """Whether the group has a status report, which is then its first report."""
        samples = self.group.samples
        return bool(samples) and isinstance(samples[0], Status)


class Faults:
    """Errors raised by the code for one robot; only bugs can cause such errors.

    Attributes:
        errors: The errors by the robot's number; the caller of ``Simulation.step``
            raises them, or removes these robots.
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
        except Exception as error:  # noqa: BLE001 - other robots must keep running
            self.errors[vehicle.number] = error
            return None


class DueScan(NamedTuple):
    """A scan that an add-on reads in this tick.

    Attributes:
        vehicle: The robot that carries the scanner.
        scan: The scan.
        reports: Reports that are sent before the scan, such as targets; empty if there
            is no receiver.
        is_requested: As in ``ScanEchoes``.
    """

    vehicle: Vehicle
    scan: RangeScan
    reports: Sequence[SensorReport] = ()
    is_requested: bool = False


class ScannerItems(Protocol):
    """Interface of an add-on that reads some scanners of robots at its own times.

    For each add-on in the group ``radarsim.items`` of ``plugins``, a simulation creates
    one instance from its scene and its clock.
    """

    def add(self, vehicle: Vehicle) -> None:
        """Start to read those scanners of a robot that this add-on supports."""

    def remove(self, vehicle: Vehicle) -> None:
        """Stop reading the scanners of a robot."""

    def read_due(
        self, find_boxes: Callable[[], Boxes], faults: Faults
    ) -> Sequence[DueScan]:
        """Advance by one tick, and return the scans that are due.

        Args:
            find_boxes: Returns the boxes of all robots.
            faults: Collects errors of single robots.
        """
        ...


def report_scan(
    time: float, name: str, settings: SensorSettings, ranges: Floats
) -> RangeScan:
    """Return the report of a scan.

    Args:
        time: Simulated time, s.
        name: Name of the item.
        settings: Settings of the scanner.
        ranges: (N,) m; the maximum range for beams without a return.
    """
    resolution, fov = math.radians(settings.resolution_deg), settings.fov_deg
    return RangeScan(time, name, resolution, math.radians(fov), ranges)
