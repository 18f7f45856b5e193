"""Reads the properties of a robot and its scanners from reports of a server.

Servers do not report all properties: the original server reports the wheel base instead
of the size of the robot, and no server reports the unit of wheel speeds. Values that
this module assumes are conservative, for example a larger robot.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final, Self, TypeAlias

import numpy as np

from radarsim.errors import ClientError, did_you_mean
from radarsim.geometry import Floats, Pose3
from radarsim.protocol.dialect import RAD_PER_S, DriveUnit
from radarsim.protocol.message import LARGEST_COMMANDED
from radarsim.protocol.reports import (
    ItemGeo,
    RangeScan,
    Report,
    RobotConf,
    RobotGeo,
    ScannerConf,
)

DEFAULT_MOUNT: Final = Pose3(0.0, 0.0, 0.0)  # of a scanner whose mount is not reported
WHEEL_LIMITS: Final = (1e-3, 1e3)  # m or drive units; plausible for a wheeled robot
MAX_BEAMS: Final = 100_000
MAX_MOUNT_DISTANCE: Final = 10.0  # m from the robot's centre
_PRINTED = 0.01  # rad; tolerance for a field of view of 2 pi that was rounded up
_HALF_DIGIT: Final = 0.006  # m; slightly more than half of a range's last digit, 0.01 m
_FAR: Final = 1e3  # m; assumed range of beams without return, to compute their bearings


# Reported settings of a scanner: maximum and minimum range, m, resolution and field of
# view, rad.
_Limits: TypeAlias = tuple[float, float, float, float]
UNLIMITED: Final[_Limits] = (math.inf, 0.0, math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class ScannerInfo:
    """The properties of one scanner of a robot, such as its mounting pose.

    Attributes:
        name: Name of the scanner in its scans.
        mount: Pose in the body frame.
        min_range: Minimum range, m.
        max_range: Range of a beam without return, m; ``inf`` if it is not reported.
        resolution: Angle between neighbouring beams, rad.
        fov: Angle between the first beam and the last, rad.
        beams: Number of beams.
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
        """Angles of the beams, (N,) rad, from right to left; 0 is straight ahead."""
        return np.linspace(-self.fov / 2, self.fov / 2, self.beams)


@dataclass(frozen=True, slots=True)
class RobotInfo:
    """The properties of one robot: its class, dimensions, limits and scanners.

    Attributes:
        name: Class of the robot.
        length: Length of the robot, m.
        width: Width of the robot, m.
        height: Height of the robot, m; 0 if it is not reported.
        wheel_radius: Radius of the wheels, m.
        wheel_separation: Distance between left and right wheels, m.
        max_wheel_speed: Maximum speed of a wheel at its rim, m/s.
        drive_scale: Drive units per rad/s.
        scanners: Scanners in the order of the server.
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
        """Create the properties of a robot from its geometry and its configuration.

        Raises:
            ClientError: If a wheel dimension or the size of the robot is not plausible.
        """
        wheels = {
            "WheelRadius": geo.wheel_radius,
            "WheelSeparation": geo.wheel_separation,
            "MaxSpeed": conf.max_speed,
        }
        least, most = WHEEL_LIMITS
        for key, value in wheels.items():
            # With ``not`` in this condition, NaN is out of range as well.
            if not least <= value <= most:
                text = f"{key} {value:g} of robot {geo.name[:80]!r}"
                raise ClientError(f"{text}, expected {least:g} to {most:g}")
        if not min(geo.dimensions) >= 0:
            text = f"Dimensions {geo.dimensions} of robot {geo.name[:80]!r}"
            raise ClientError(f"{text}, expected none below 0")
        length, width, height = dimensions(geo)
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
        """Radius of the free circle, m, that the robot needs to turn on the spot.

        It is half the diagonal of the robot's footprint.
        """
        return math.hypot(self.length, self.width) / 2

    @property
    def top_speed(self) -> float:
        """Maximum speed of the robot straight ahead, m/s."""
        return self.max_wheel_speed

    def wheel_speeds(self, speed: float, turn: float) -> tuple[float, float]:
        """Convert speed and yaw rate to left and right wheel speeds in drive units.

        If a wheel would exceed its maximum speed, both speeds are scaled down by the
        same factor, so that the robot still follows the same curve.

        Args:
            speed: Forward speed, m/s.
            turn: Counter-clockwise yaw rate, rad/s.
        """
        # Without these limits, wheel speeds could be infinite, and the ratio to the
        # maximum NaN.
        most = LARGEST_COMMANDED
        speed, turn = (max(min(each, most), -most) for each in (speed, turn))
        across = turn * self.wheel_separation / 2
        left, right = speed - across, speed + across
        fastest = max(abs(left), abs(right))
        if fastest > self.max_wheel_speed:
            left *= self.max_wheel_speed / fastest
            right *= self.max_wheel_speed / fastest
        factor = self.drive_scale / self.wheel_radius
        return left * factor, right * factor

    def scanner(self, name: str | None = None) -> ScannerInfo:
        """Return the robot's scanner with a name, in any case; None means the first.

        Raises:
            ClientError: If the robot has no such scanner.
        """
        wanted, text = "a scanner", str(name)
        for scanner in self.scanners:
            if name is None or same_name(scanner.name, text):
                return scanner
        names = [scanner.name for scanner in self.scanners]
        if name is not None:
            wanted = f"the scanner {text[:80]!r}{did_you_mean(text, names)}"
        raise ClientError(f"scanners of {self.name!r}: {names}, expected {wanted}")


def same_name(one: str, other: str) -> bool:
    """Compare two names case-insensitively, as servers mix upper and lower case."""
    return one.casefold() == other.casefold()


def is_plausible(scan: RangeScan) -> bool:
    """Return whether a scan has a field of view and finite ranges of at least 0."""
    has_fov = scan.fov > 0 or (len(scan.ranges) == 1 and scan.fov == 0)
    ranges = scan.ranges
    has_lengths = not len(ranges) or (ranges.min() >= 0 and ranges.max() < np.inf)
    return bool(has_fov and has_lengths) and not _is_too_wide(scan.fov, scan.resolution)


def beam_angles(scan: RangeScan) -> Floats:
    """Return the angles of a scan's beams, (N,) rad, as ``scan.angles`` does."""
    return scan.angles


def no_return(max_range: float) -> float:
    """Return the smallest range, m, that counts as a beam without return.

    Args:
        max_range: Reported maximum range, m; ``inf`` if it is not reported.
    """
    if not math.isfinite(max_range):
        return max_range
    # Most servers round ranges to two decimals; the original server truncates them in
    # single precision. MaxRange has more decimals: with 5.609 m, a beam without return
    # reads 5.61 or 5.60 m, and with 2.3 m it may read 2.29 m.
    nothing = math.floor(100 * float(np.float32(max_range))) / 100
    return nothing - _HALF_DIGIT  # a margin, because MaxRange itself may be rounded


def from_centre(
    ranges: Floats, angles: Floats, mount: Pose3, max_range: float
) -> tuple[Floats, Floats]:
    """Convert a scan to bearings and ranges from the robot's centre.

    Args:
        ranges: (N,) ranges from the scanner, m.
        angles: (N,) angles, rad, counter-clockwise from the scanner's front.
        mount: Pose of the scanner in the body frame; level, at any height.
        max_range: Range of a beam without return, m.

    Returns:
        (N,) bearings, rad, counter-clockwise from the robot's front, in [-pi, pi), and
        (N,) ranges, m, ``inf`` without return.
    """
    returned = ranges < no_return(max_range)
    # Infinite ranges are replaced: arctan2 of infinities gives multiples of 45 degrees.
    lengths = np.where(returned, ranges, _FAR)
    angles = angles + mount.yaw
    x = mount.x + lengths * np.cos(angles)
    y = mount.y + lengths * np.sin(angles)
    bearings = np.arctan2(y, x)
    # arctan2 may give pi for obstacles behind the robot; bearings are below pi.
    bearings[bearings >= math.pi] = -math.pi
    return bearings, np.where(returned, np.hypot(x, y), math.inf)


def dimensions(geo: RobotGeo) -> tuple[float, float, float]:
    """Return length, width and height, m, of a robot that a server has described.

    The original server reports wheel base and separation instead, and no height. The
    robot is then assumed to extend one wheel radius beyond its wheels on all sides,
    which is more than its real size.
    """
    length, width, height = geo.dimensions
    if height > 0:
        return length, width, height
    beyond = 2 * geo.wheel_radius
    length, width = max(length, geo.wheel_base), max(width, geo.wheel_separation)
    return length + 2 * beyond, width + beyond, 0.0


class ScannerDescriptions:
    """Collects the answers of a server to questions about a robot's scanners.

    Not every server answers all questions about scanners; scans supply the missing
    properties. Names that differ only in case belong to one scanner.
    """

    def __init__(self) -> None:
        self._names: dict[
            str, str
        ] = {}  # first spelling of each name by its casefolded form
        self._mounts: dict[str, Pose3] = {}
        self._limits: dict[str, _Limits] = {}

    def add(self, report: Report) -> None:
        """Add an answer of the server about scanners; ignore other reports."""
        if isinstance(report, ItemGeo):
            for name, mount in report.mounts:
                self._mounts[self._key(name)] = mount
        elif isinstance(report, ScannerConf):
            for name, *limits in report.items:
                self._limits[self._key(name)] = tuple(limits)

    def _key(self, name: str) -> str:
        key = name.casefold()
        self._names.setdefault(key, name)
        return key

    def names(self, scans: Iterable[str]) -> list[str]:
        """Return the names of all scanners that answers or scans contain."""
        names = {name.casefold(): name for name in scans} | self._names
        keys = (*self._mounts, *self._limits, *names)
        return [names[key] for key in dict.fromkeys(keys)]

    def incomplete(self, scans: Iterable[str]) -> list[str]:
        """Return the names of scanners whose mounting pose or settings are unknown."""
        complete = self._mounts.keys() & self._limits.keys()
        return [name for name in self.names(scans) if name.casefold() not in complete]

    def scanners(self, scans: Mapping[str, RangeScan]) -> tuple[ScannerInfo, ...]:
        """Return the properties of all scanners whose number of beams is known.

        Args:
            scans: Latest scans by name. The number of beams of a scanner is taken from
                its scan, if there is one.

        Raises:
            ClientError: If the settings of a scanner are not plausible.
        """
        by_key = {name.casefold(): scan for name, scan in scans.items()}
        scanners = []
        for name in self.names(scans):
            key = name.casefold()
            limits = self._limits.get(key, UNLIMITED)
            mount = self._mounts.get(key, DEFAULT_MOUNT)
            _check_scanner(name, limits, mount)
            scan = by_key.get(key)
            layout = _beam_layout(limits, scan)
            if layout is not None:
                # Users look up scanners by the name in scans, so that spelling is used.
                spelling = name if scan is None else scan.name
                farthest, nearest = limits[:2]
                scanners.append(
                    ScannerInfo(spelling, mount, nearest, farthest, *layout)
                )
        return tuple(scanners)


def _check_scanner(name: str, limits: _Limits, mount: Pose3) -> None:
    max_range, _, resolution, fov = limits
    far = math.hypot(mount.x, mount.y, mount.z)
    wrong = ""
    if max_range <= 0:
        wrong = f"MaxRange {max_range:g}, expected more than 0"
    elif fov < 0 or _is_too_wide(fov, resolution):
        wrong = f"FOV {fov:g}, expected 0 to 2 pi radians"
    elif 0 < resolution < fov / MAX_BEAMS:
        text = f"Resolution {resolution:g} for FOV {fov:g}"
        wrong = f"{text}, expected at most {MAX_BEAMS} beams"
    elif far > MAX_MOUNT_DISTANCE:
        text = f"mount {far:g} m from the robot's centre"
        wrong = f"{text}, expected at most {MAX_MOUNT_DISTANCE:g} m"
    if wrong:
        raise ClientError(f"scanner {name[:80]!r} has {wrong}")


def _is_too_wide(fov: float, resolution: float) -> bool:
    """Return whether the beams span more than a full circle and one resolution step."""
    turn = 2 * math.pi
    step = resolution if 0 < resolution < turn else 0.0  # ignore implausible values
    return fov > turn + step + _PRINTED


def _beam_layout(
    limits: _Limits, scan: RangeScan | None
) -> tuple[float, float, int] | None:
    """Return resolution, rad, field of view, rad, and beam count; None if unknown."""
    if scan is not None:
        gaps = len(scan.ranges) - 1
        return (scan.fov / gaps if gaps else scan.resolution), scan.fov, gaps + 1
    _, _, resolution, fov = limits
    if not (resolution > 0 and fov >= 0):
        return None
    # Both numbers are rounded in reports, so the quotient may be just below an integer.
    return resolution, fov, int(fov / resolution + 0.02) + 1
