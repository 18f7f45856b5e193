"""What a client must know of its robot, by what the robot says of itself.

Servers tell less than one would like: the original tells of the hull only by its
wheels, and of the unit of wheel speeds not at all. What is filled in here is on the
safe side.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from radarsim.errors import ClientError
from radarsim.geometry import Floats, Pose3
from radarsim.protocol.dialect import RAD_PER_S, DriveUnit
from radarsim.protocol.reports import (
    ItemGeo,
    RangeScan,
    Report,
    RobotConf,
    RobotGeo,
    ScannerConf,
)

DEFAULT_MOUNT: Final = Pose3(0.0, 0.0, 0.0)  # taken for a mount that nobody tells of
WHEELS: Final = (1e-3, 1e3)  # m and drive units; what no robot on wheels is outside of
MOST_BEAMS: Final = 100_000
FARTHEST_MOUNT: Final = 10.0  # m from the robot's centre
_PRINTED = 0.01  # rad by which a whole turn may come out larger than it is


@dataclass(frozen=True, slots=True)
class ScannerLimits:
    """What a server configures a scanner by; range limits in m, angles in rad."""

    max_range: float
    min_range: float
    resolution: float
    fov: float


UNLIMITED: Final = ScannerLimits(math.inf, 0.0, math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class ScannerInfo:
    """One scanner.

    Attributes:
        name: Of its scans.
        mount: In the body frame.
        min_range: m.
        max_range: m, which a beam without return reads; ``inf`` if nobody tells.
        resolution: Angle between neighbouring beams, rad.
        fov: Angle between the first beam and the last, rad.
        beams: How many there are.
    """

    name: str
    mount: Pose3
    min_range: float
    max_range: float
    resolution: float
    fov: float
    beams: int

    @property
    def angles(self) -> Floats:
        """(N,) rad, counter-clockwise from the right, 0 ahead of the scanner."""
        return np.linspace(-self.fov / 2, self.fov / 2, self.beams)


@dataclass(frozen=True, slots=True)
class RobotInfo:
    """One robot.

    Attributes:
        name: Its class.
        length: Of the hull, m.
        width: Of the hull, m.
        height: Of the hull, m; 0 if nobody tells.
        wheel_radius: m.
        wheel_separation: Between left and right wheels, m.
        max_wheel_speed: m/s at the rim.
        drive_scale: What the server takes for a wheel's spin of 1 rad/s.
        scanners: In the order in which the server names them.
    """

    name: str
    length: float
    width: float
    height: float
    wheel_radius: float
    wheel_separation: float
    max_wheel_speed: float
    drive_scale: float
    scanners: tuple[ScannerInfo, ...]

    @classmethod
    def from_reports(
        cls,
        geo: RobotGeo,
        conf: RobotConf,
        scanners: tuple[ScannerInfo, ...],
        drive_unit: DriveUnit,
    ) -> Self:
        """Put together what a robot says of itself.

        Raises:
            ClientError: If a wheel dimension or the hull is not plausible.
        """
        wheels = {
            "WheelRadius": geo.wheel_radius,
            "WheelSeparation": geo.wheel_separation,
            "MaxSpeed": conf.max_speed,
        }
        least, most = WHEELS
        for key, value in wheels.items():
            if not least <= value <= most:
                text = f"{key} {value:g} of robot {geo.name[:80]!r}"
                raise ClientError(f"{text}, expected {least:g} to {most:g}")
        if not min(geo.dimensions) >= 0:
            text = f"Dimensions {geo.dimensions} of robot {geo.name[:80]!r}"
            raise ClientError(f"{text}, expected none below 0")
        length, width, height = hull(geo)
        scale = 1 / RAD_PER_S[drive_unit]
        return cls(
            name=geo.name,
            length=length,
            width=width,
            height=height,
            wheel_radius=geo.wheel_radius,
            wheel_separation=geo.wheel_separation,
            max_wheel_speed=conf.max_speed / scale * geo.wheel_radius,
            drive_scale=scale,
            scanners=scanners,
        )

    @property
    def clearance(self) -> float:
        """Half the diagonal of the hull, m: what it needs around it to turn."""
        return math.hypot(self.length, self.width) / 2

    @property
    def top_speed(self) -> float:
        """Straight ahead, m/s."""
        return self.max_wheel_speed

    def wheel_speeds(self, speed: float, turn: float) -> tuple[float, float]:
        """Give the spin of the left and the right wheels for a motion, in drive units.

        Where a wheel would have to be faster than it can, both are slowed down by one
        factor, so that the robot still follows the same curve.

        Args:
            speed: Ahead, m/s.
            turn: Counter-clockwise, rad/s.
        """
        across = turn * self.wheel_separation / 2
        left, right = speed - across, speed + across
        fastest = max(abs(left), abs(right))
        if fastest > self.max_wheel_speed:
            left *= self.max_wheel_speed / fastest
            right *= self.max_wheel_speed / fastest
        factor = self.drive_scale / self.wheel_radius
        return left * factor, right * factor

    def scanner(self, name: str | None = None) -> ScannerInfo:
        """Give one scanner, by default the first.

        Raises:
            ClientError: If the robot has no such scanner.
        """
        for scanner in self.scanners:
            if name is None or same_name(scanner.name, name):
                return scanner
        wanted = "a scanner" if name is None else f"the scanner {name[:80]!r}"
        names = [scanner.name for scanner in self.scanners]
        raise ClientError(f"robot {self.name!r} has {names}, expected {wanted}")


def same_name(one: str, other: str) -> bool:
    """Tell whether two names are one item's; servers mix upper and lower case."""
    return one.casefold() == other.casefold()


def is_sound(scan: RangeScan) -> bool:
    """Tell whether a scan can be one: its beams fan out, and its ranges are lengths."""
    fans = scan.fov > 0 or (len(scan.ranges) == 1 and scan.fov == 0)
    lengths = bool(np.all((scan.ranges >= 0) & (scan.ranges < np.inf)))
    return fans and lengths and not _is_too_wide(scan.fov, scan.resolution)


def beam_angles(scan: RangeScan) -> Floats:
    """Give the angles of a scan's beams, (N,) rad, 0 ahead of the scanner.

    By the field of view and the number of ranges: the resolution is printed with few
    digits, and over half a circle an error in it adds up to half a degree.
    """
    return np.linspace(-scan.fov / 2, scan.fov / 2, len(scan.ranges))


def hull(geo: RobotGeo) -> tuple[float, float, float]:
    """Give length, width and height of a robot, m.

    The original server tells the wheel base and separation instead, and no height. The
    hull is then taken to reach one wheel's radius beyond the wheels on all sides, which
    is more than that of the robots it has.
    """
    length, width, height = geo.dimensions
    if height > 0:
        return length, width, height
    beyond = 2 * geo.wheel_radius
    length, width = max(length, geo.wheel_base), max(width, geo.wheel_separation)
    return length + 2 * beyond, width + beyond, 0.0


class ScannerDescriptions:
    """What a server tells of scanners, as it comes.

    Servers differ in how much they answer; what a scan says is added at the end. Names
    that differ in case only are those of one scanner.
    """

    def __init__(self) -> None:
        self._names: dict[str, str] = {}  # as they came first; all keys are casefolded
        self._mounts: dict[str, Pose3] = {}
        self._limits: dict[str, ScannerLimits] = {}

    def add(self, report: Report) -> None:
        """Take in an answer; what is none of scanners changes nothing."""
        if isinstance(report, ItemGeo):
            for name, mount in report.mounts:
                self._mounts[self._key(name)] = mount
        elif isinstance(report, ScannerConf):
            for name, *numbers in report.items:
                self._limits[self._key(name)] = ScannerLimits(*numbers)

    def _key(self, name: str) -> str:
        key = name.casefold()
        self._names.setdefault(key, name)
        return key

    def names(self, scans: Iterable[str]) -> list[str]:
        """Give all names that occurred, given those that scans came of."""
        names = {name.casefold(): name for name in scans} | self._names
        keys = (*self._mounts, *self._limits, *names)
        return [names[key] for key in dict.fromkeys(keys)]

    def incomplete(self, scans: Iterable[str]) -> list[str]:
        """Give the names of those that have not told everything."""
        complete = self._mounts.keys() & self._limits.keys()
        return [name for name in self.names(scans) if name.casefold() not in complete]

    def scanners(self, scans: Mapping[str, RangeScan]) -> tuple[ScannerInfo, ...]:
        """Put all together; who says nothing of its beams is left out.

        Args:
            scans: By name; of the beams a scan tells best, since they can be counted.

        Raises:
            ClientError: If a scanner is told to be what none can be.
        """
        seen = {name.casefold(): scan for name, scan in scans.items()}
        facts = []
        for name in self.names(scans):
            key = name.casefold()
            limits = self._limits.get(key, UNLIMITED)
            mount = self._mounts.get(key, DEFAULT_MOUNT)
            _check_scanner(name, limits, mount)
            scan = seen.get(key)
            fan = _fan(limits, scan)
            if fan is not None:
                told = name if scan is None else scan.name
                nearest, farthest = limits.min_range, limits.max_range
                facts.append(ScannerInfo(told, mount, nearest, farthest, *fan))
        return tuple(facts)


def _check_scanner(name: str, limits: ScannerLimits, mount: Pose3) -> None:
    far = math.hypot(mount.x, mount.y, mount.z)
    wrong = ""
    if limits.max_range <= 0:
        wrong = f"MaxRange {limits.max_range:g}, expected more than 0"
    elif limits.fov < 0 or _is_too_wide(limits.fov, limits.resolution):
        wrong = f"FOV {limits.fov:g}, expected 0 to a whole turn in radians"
    elif 0 < limits.resolution < limits.fov / MOST_BEAMS:
        text = f"Resolution {limits.resolution:g} for FOV {limits.fov:g}"
        wrong = f"{text}, expected at most {MOST_BEAMS} beams"
    elif far > FARTHEST_MOUNT:
        text = f"mount {far:g} m from the robot's centre"
        wrong = f"{text}, expected at most {FARTHEST_MOUNT:g} m"
    if wrong:
        raise ClientError(f"scanner {name[:80]!r} has {wrong}")


def _is_too_wide(fov: float, resolution: float) -> bool:
    """Tell whether beams go round more than once, by more than one step."""
    turn = 2 * math.pi
    step = resolution if 0 < resolution < turn else 0.0  # it may be nonsense itself
    return fov > turn + step + _PRINTED


def _fan(
    limits: ScannerLimits, scan: RangeScan | None
) -> tuple[float, float, int] | None:
    """Give resolution, field of view and number of beams, or None."""
    if scan is not None:
        gaps = len(scan.ranges) - 1
        return (scan.fov / gaps if gaps else scan.resolution), scan.fov, gaps + 1
    if not (limits.resolution > 0 and limits.fov >= 0):
        return None
    # Both are printed with few digits, so a whole number may come out a little less.
    gaps = int(limits.fov / limits.resolution + 0.02)
    return limits.resolution, limits.fov, gaps + 1
