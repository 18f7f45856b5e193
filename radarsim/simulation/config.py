"""Simulated time: whole ticks of 10 ms, so that times never drift from their digits."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from radarsim.errors import PresetError
from radarsim.presets.robots import Item, load_robot, robot_names
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.presets.sensors import load_settings
from radarsim.protocol.dialect import COMPAT, MAX_WHEEL_SPEEDS, Dialect, DriveUnit
from radarsim.robots.skid_steer import WheelDrive
from radarsim.sensors.proprioceptive import InsNoise
from radarsim.sensors.range_scanner import RangeScanner

TICK: Final = 0.01  # s


def seconds(ticks: int) -> float:
    """Give the time of a tick, s."""
    return ticks / 100


def ticks_of(interval: float) -> int:
    """Give the number of ticks nearest to an interval in s, at least one."""
    return max(1, round(interval / TICK))


# Section from simulation.conditions.
# What holds for every robot of a simulation.


@dataclass(frozen=True, slots=True)
class SimulationConfig:
    """How robots are driven, and how their items differ from their presets.

    Attributes:
        dialect: Rates, limits and the unit of DRIVE.
        drive_unit: Of DRIVE, where it is not to be the dialect's.
        item_settings: Settings by the name of the item, of whatever robot; of a scanner
            also ``sensor``, the name of another preset.
    """

    dialect: Dialect = COMPAT
    drive_unit: DriveUnit | None = None
    item_settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def check(self) -> None:
        """Try all settings on all robot classes.

        Raises:
            PresetError: If no class has such an item, or it has no such setting, or a
                value does not fit.
        """
        items = [item for name in robot_names() for item in load_robot(name).items]
        for name in self.item_settings:
            named = [item for item in items if item.name.casefold() == name.casefold()]
            if not named:
                known = sorted({item.name for item in items})
                raise PresetError(f"item {name[:80]!r}, expected one of {known}")
            for item in named:
                self._try(item)

    def _try(self, item: Item) -> None:
        if item.type == "RangeScanner":
            self.scanner(item)
        elif item.type == "INS":
            InsNoise.from_settings(self.settings(item))
        elif self.settings(item):
            raise PresetError(f"item {item.name!r}: type {item.type} has no settings")

    def wheel_drive(self) -> WheelDrive:
        """Give the meaning of DRIVE's numbers."""
        unit = self.drive_unit or self.dialect.drive_unit
        return WheelDrive(MAX_WHEEL_SPEEDS[unit], unit)

    def settings(self, item: Item) -> dict[str, Any]:
        """Give an item's settings: its class's, the dialect's, and over them these.

        Those of the class and the dialect are for the class's own sensor.
        """
        own = self._own(item)
        if item.sensor is None or own.pop("sensor", item.sensor) != item.sensor:
            return own if item.sensor else {**item.settings, **own}
        settings = dict(item.settings)
        longest = self.dialect.laser_max_range
        if longest is not None and item.sensor != "hokuyo":
            settings["max_range"] = longest
        return settings | own

    def _own(self, item: Item) -> dict[str, Any]:
        """Give the settings that are set for an item by its name, in any case."""
        return {
            key: value
            for name, own in self.item_settings.items()
            if name.casefold() == item.name.casefold()
            for key, value in own.items()
        }

    def scanner(self, item: Item) -> RangeScanner:
        """Make the scanner that an item is.

        Raises:
            PresetError: If its settings do not fit.
        """
        if item.sensor is None:
            raise ValueError(
                f"item {item.name!r}: type {item.type}, expected a scanner"
            )
        return RangeScanner(self._sensor(item), self._scanner_settings(item))

    def _sensor(self, item: Item) -> str:
        return str(self._own(item).get("sensor", item.sensor))

    def _scanner_settings(self, item: Item) -> SensorSettings:
        return load_settings(self._sensor(item), **self.settings(item))

    def interval(self, item: Item) -> float:
        """Give the time between two readings of an item, s."""
        if item.interval is not None:
            return item.interval
        if item.sensor is not None:
            rate = self._scanner_settings(item).scan_rate_hz
            return 1 / rate if rate else self.dialect.scan_interval_of(item.sensor)
        if item.type == "INS":
            return self.dialect.ins_interval
        if item.type == "Tachometer":
            return self.dialect.tachometer_interval
        return DEFAULT_INTERVAL


DEFAULT_INTERVAL = 0.1  # s, of every other sensor and of the status
