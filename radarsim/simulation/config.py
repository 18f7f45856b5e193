"""Configuration of a simulation, and limits for changes by clients.

The engine is not imported until a scanner is created.

``MOST_RAYS`` and the constants after it limit the number of rays that a client may
request by changing the settings of a scanner; ``check_rays`` checks the limits. All
robots share the time of a tick, so one client must not slow down the others. The
configuration at the start of the simulation may exceed the limits, and clients may then
request the same number of rays. Limits of settings are in ``presets.sensor_settings``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final, Self

from radarsim.errors import PresetError, expected_one_of
from radarsim.presets.robots import Item, RobotModel, load_robot, robot_names
from radarsim.presets.sensor_settings import CameraSettings, SensorSettings
from radarsim.presets.sensors import (
    has_fmcw,
    item_settings,
    load_fmcw_settings,
    load_settings,
)
from radarsim.protocol.dialect import (
    COMPAT,
    MAX_WHEEL_SPEEDS,
    RAD_PER_S,
    Dialect,
    DriveUnit,
    WheelDrive,
)

if TYPE_CHECKING:
    from radarsim.sensors.range_scanner import RangeScanner

DEFAULT_INTERVAL: Final = 0.1  # s; of the status, and of items without an interval
MOST_RAYS: Final = 2_000  # rays per scan; a scan with all echoes then takes some ms
MOST_RAYS_A_SECOND: Final = 50_000
MOST_EXTRA_RAYS: Final = 500_000  # per second, added by changes of all robots together
MOST_DIRECTIONS: Final = 5_000  # per scan, prepared in 1 ms; rays are drawn from them
LIMITS: Final = (MOST_RAYS, MOST_RAYS_A_SECOND, MOST_DIRECTIONS)
NAMES: Final = ("rays in a scan", "rays a second", "directions of rays in a scan")


@dataclass(frozen=True, slots=True)
class SimulationConfig:
    """Configuration: the command dialect, settings of items, and more robot classes.

    Attributes:
        dialect: Rates, limits and the unit of DRIVE.
        drive_unit: Unit of DRIVE; None for the dialect's unit.
        item_settings: Settings by item name, for items of all robots; a scanner also
            has ``sensor``, the name of another preset.
        robots: Robot classes in addition to the shipped classes; a class replaces the
            shipped class with the same name.
    """

    dialect: Dialect = COMPAT
    drive_unit: DriveUnit | None = None
    item_settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    robots: tuple[RobotModel, ...] = ()

    def robot_names(self) -> tuple[str, ...]:
        """Return the names of all robot classes that can be spawned."""
        return tuple(dict.fromkeys((*robot_names(), *(r.name for r in self.robots))))

    def robot(self, class_name: str) -> RobotModel:
        """Return the robot class with a name, ignoring case.

        Raises:
            PresetError: If there is no such class.
        """
        for model in self.robots:
            if model.name.casefold() == class_name.casefold():
                return model
        return load_robot(class_name)

    def check(self) -> None:
        """Check the item settings against all robot classes, and the added classes.

        Raises:
            PresetError: If no class has such an item, or the item has no such setting,
                or a value is out of range, or there is no such sensor.
            TypeError: If the dialect is not a Dialect.
        """
        if not isinstance(self.dialect, Dialect):
            expected = "a Dialect of radarsim.protocol.dialect, such as UDK"
            raise TypeError(f"dialect {self.dialect!r}, expected {expected}")
        items = [i for name in self.robot_names() for i in self.robot(name).items]
        for model in self.robots:
            for item in model.items:
                self.settings_of(item)
        for name in self.item_settings:
            named = [item for item in items if item.name.casefold() == name.casefold()]
            if not named:
                known = sorted({item.name for item in items})
                raise PresetError(f"item {expected_one_of(name, known)}")
            for item in named:
                try:
                    self.settings_of(item)
                except PresetError as error:
                    text, own = str(error), f"item {item.name}: "
                    own = "" if text.startswith("item ") else own
                    raise PresetError(own + text) from None

    def check_scanners(self, model: RobotModel) -> None:
        """Check that all scanners of a robot class can be created.

        Raises:
            PresetError: If a required add-on is missing, or a setting is invalid.
        """
        for item in model.items_of("RangeScanner"):
            self.scanner_settings(item)

    @property
    def wheel_unit(self) -> DriveUnit:
        """The unit of the wheel speeds in DRIVE commands."""
        return self.drive_unit or self.dialect.drive_unit

    def wheel_drive(self, model: RobotModel) -> WheelDrive:
        """Return the unit and the limit of a robot's wheel speeds in DRIVE commands."""
        unit = self.wheel_unit
        if model.flight is not None:
            fastest = model.flight.max_linear / model.wheel_radius
            return WheelDrive(fastest / RAD_PER_S[unit], unit)
        if model.max_rev_per_s is None:
            return WheelDrive(MAX_WHEEL_SPEEDS[unit], unit)
        return WheelDrive(model.max_rev_per_s * 2 * math.pi / RAD_PER_S[unit], unit)

    def settings(self, item: Item) -> dict[str, Any]:
        """Return the settings of an item, from robot class, dialect and configuration.

        Settings of the class and the dialect are dropped if ``sensor`` is replaced.
        """
        own = self._own_settings(item)
        if item.sensor is None:
            return {**item.settings, **own}
        if own.pop("sensor", item.sensor) != item.sensor:
            return own
        settings = dict(item.settings)
        max_range = self.dialect.laser_max_range
        # Hokuyo lasers and FMCW radars keep their maximum range in all dialects.
        has_own = item.sensor == "hokuyo" or has_fmcw(item.sensor)
        if max_range is not None and not has_own:
            settings["max_range"] = max_range
        return settings | own

    def _own_settings(self, item: Item) -> dict[str, Any]:
        """Return the settings that this configuration has for an item, by its name."""
        return {
            key: value
            for name, own in self.item_settings.items()
            if name.casefold() == item.name.casefold()
            for key, value in own.items()
        }

    def with_settings(self, item: Item, settings: Mapping[str, Any]) -> Self:
        """Return a copy of this configuration with some settings of an item changed.

        Raises:
            PresetError: If the item has no such setting, or a value is out of range.
        """
        name = item.name.casefold()
        others = {k: v for k, v in self.item_settings.items() if k.casefold() != name}
        own = {**self._own_settings(item), **settings}
        changed = replace(self, item_settings={**others, item.name: own})
        changed.settings_of(item)
        return changed

    def scanner(self, item: Item) -> RangeScanner:
        """Create the scanner of an item.

        Raises:
            PresetError: If a setting is unknown or out of range.
        """
        from radarsim.sensors.range_scanner import RangeScanner  # noqa: PLC0415

        if item.sensor is None:
            raise ValueError(
                f"item {item.name!r}: type {item.type}, expected a scanner"
            )
        return RangeScanner(self.sensor_name(item), self.scanner_settings(item))

    def sensor_name(self, item: Item) -> str:
        """Return the name of the preset of a scanner item."""
        return str(self._own_settings(item).get("sensor", item.sensor))

    def scanner_settings(self, item: Item) -> SensorSettings:
        """Return the settings of a scanner item.

        Raises:
            PresetError: If a setting is unknown or out of range.
        """
        return load_settings(self.sensor_name(item), **self.settings(item))

    def settings_of(self, item: Item) -> Any:
        """Return the settings of an item; None if the item has no settings.

        Raises:
            PresetError: If a setting is unknown or out of range.
        """
        from radarsim.sensors.sensor import kinds  # noqa: PLC0415

        if item.type == "RangeScanner":
            return self.scanner_settings(item)
        kind = kinds().get(item.type)
        model = kind.settings if kind else None
        if item.type == "Camera":
            model = CameraSettings
        settings = self.settings(item)
        if model is not None:
            return item_settings(item.type, model, **settings)
        if settings:
            raise PresetError(f"item {item.name!r}: type {item.type} has no settings")
        return None

    def interval(self, item: Item) -> float:
        """Return the time between two readings of an item, s."""
        if item.interval is not None:
            return item.interval
        if item.sensor is not None:
            settings = self.scanner_settings(item)
            if settings.has_detector:
                return 1 / load_fmcw_settings(self.sensor_name(item)).rotation_hz
            rate = settings.scan_rate_hz
            return 1 / rate if rate else self.dialect.scan_interval_of(item.sensor)
        attribute = f"{item.type.lower()}_interval"  # such as ``gps_interval``
        return float(getattr(self.dialect, attribute, DEFAULT_INTERVAL))


def _count_rays(item: Item, config: SimulationConfig) -> tuple[float, float, float]:
    """Return those numbers of a scanner's rays that have limits, as in ``NAMES``."""
    settings, interval = config.scanner_settings(item), config.interval(item)
    if settings.has_detector:
        fmcw = load_fmcw_settings(config.sensor_name(item))
        # The number of rays per revolution, without
        # the rays that are added at thin objects.
        rays = fmcw.azimuths * fmcw.rays_across * fmcw.rays_up
        return rays, rays / interval, rays
    directions = settings.beams * settings.rays_per_beam
    rays = directions if settings.combines_rays else settings.beams
    return rays, rays / interval, directions


def check_rays(
    items: Iterable[Item],
    config: SimulationConfig,
    first: SimulationConfig,
    before: float,
    others: float,
) -> float:
    """Check how many rays a robot's scanners have after a change of their settings.

    Args:
        items: The range scanners of the robot.
        config: The changed configuration.
        first: The configuration that the robot was spawned with.
        before: The rays per second that earlier changes have added; a change to fewer
            rays is always allowed.
        others: The rays per second that changes have added to all other robots.

    Returns:
        The rays per second that changes have added, including this change.

    Raises:
        PresetError: If a limit is exceeded.
    """
    extra = 0.0
    for item in items:
        counts, at_first = _count_rays(item, config), _count_rays(item, first)
        for name, count, old, limit in zip(
            NAMES, counts, at_first, LIMITS, strict=True
        ):
            if count > max(limit, old):
                most = f"expected at most {max(limit, old):.0f}"
                raise PresetError(f"item {item.name!r}: {count:.0f} {name}, {most}")
        extra += max(0.0, counts[1] - at_first[1])
    left = max(before, MOST_EXTRA_RAYS - others)
    if extra > left:
        raise PresetError(
            f"{extra:.0f} rays a second more than in the class, expected at most"
            f" {left:.0f}: other clients use the rest of {MOST_EXTRA_RAYS}"
        )
    return extra
