"""Hours of simulated time: no gap between readings, no growth of memory."""

import os
import re
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from radarsim.geometry import Floats
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

HOURS = 2.0
SECONDS = float(
    os.environ.get("RADARSIM_ENDURANCE_SECONDS")
    or (10 if os.environ.get("CI") == "true" else HOURS * 3600)
)
ROBOTS = 50
COARSE = {"lms200": {"resolution_deg": 10}}  # 19 beams a scan
SLOPE = 1.0  # MB of resident memory an hour
SHORT = 1800.0  # s; over less than that a slope is noise
NOISE = 2.0  # MB
LATE = 9_999_000  # ticks, 10 s before a time stamp gets its sixth digit
STAMP = re.compile(
    rb"(?m)^(?:STA|SEN)(?: \{Type GroundVehicle\})? \{Time ([0-9.]+)\}"
    rb"(?: \{Type (\w+)\} \{Name (\w+))?"
)
INTERVAL = 10  # ticks between two readings of an item
SLOW_INTERVALS = {  # by dialect and type of the item
    ("udk", b"RangeScanner"): 20,
    ("udk", b"Tachometer"): 20,
}

Place = tuple[float, float]


def places(count: int) -> list[Place]:
    """Return places for robots in an empty room."""
    return [(-9 + 1.9 * (i % 10), -4.8 + 2.2 * (i // 10)) for i in range(count)]


def resident_megabytes() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


class Driver:
    """A client whose robot drives at times, and whose readings are all checked."""

    def __init__(self, host: Host, dialect: Dialect, place: Place, number: int) -> None:
        self._host = host
        self._dialect = dialect
        self._phase = number
        self._client = host.connect()
        x, y = place
        name = f"{{ClassName P3AT}} {{Name R{number}}}"
        init = f"INIT {name} {{Location {x:.2f},{y:.2f},0}}\r\n"
        assert host.receive(self._client, init.encode()) == []
        assert host.has_robot(self._client)
        self._last: dict[tuple[bytes, bytes], int] = {}

    @property
    def items(self) -> set[bytes]:
        """Types of the items that have given readings."""
        return {kind for kind, _ in self._last}

    def step(self) -> None:
        """Drive for a second in ten, and check the readings of a tick."""
        tick = self._host.simulation.ticks
        second, rest = divmod(tick + self._phase * 29, 100)
        if rest == 0 and second % 10 < 2:
            speeds = 4 * np.sin([tick, self._phase + tick]) * (1 - second % 10)
            line = b"DRIVE {Left %.2f} {Right %.2f}\r\n" % tuple(speeds)
            assert self._host.receive(self._client, line) == []
        expected = STAMPS[self._dialect.name](tick)
        for stamp, kind, name in STAMP.findall(self._host.take(self._client)):
            assert stamp == expected
            interval = self._interval(kind)
            assert tick - self._last.get((kind, name), tick - interval) == interval
            self._last[kind, name] = tick
        for (kind, _), last in self._last.items():
            assert tick - last <= self._interval(kind)

    def _interval(self, kind: bytes) -> int:
        return SLOW_INTERVALS.get((self._dialect.name, kind), INTERVAL)


def decimal_stamp(tick: int) -> bytes:
    return b"%d.%02d" % divmod(tick, 100)


def single_precision_stamp(tick: int) -> bytes:
    """Write a time as the original does, which keeps it in 32 bits."""
    return b"%.4f" % float(np.float32(tick / 100))


STAMPS = {COMPAT.name: decimal_stamp, UDK.name: single_precision_stamp}


def run(drivers: list[Driver], host: Host, ticks: int) -> None:
    for _ in range(ticks):
        host.step()
        for driver in drivers:
            driver.step()


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
def test_gaps_and_stamps_are_right_across_one_hundred_thousand_seconds(
    empty_room: Scene, dialect: Dialect
) -> None:
    host = Host(empty_room, config=SimulationConfig(dialect, item_settings=COARSE))
    host.simulation.ticks = LATE
    drivers = [Driver(host, dialect, place, n) for n, place in enumerate(places(2))]
    run(drivers, host, 2000)
    assert {b"RangeScanner", b"GroundTruth"} < drivers[0].items


@pytest.mark.slow
@pytest.mark.timeout(60 + 3 * SECONDS)
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs Linux' /proc")
def test_fifty_robots_miss_no_reading_and_no_memory_grows_in_two_hours(
    empty_room: Scene, record_property: Callable[[str, object], None]
) -> None:
    host = Host(empty_room, config=SimulationConfig(item_settings=COARSE))
    drivers = []
    for number, place in enumerate(places(ROBOTS)):
        drivers.append(Driver(host, COMPAT, place, number))
        run(drivers, host, 3)  # so that scans are spread over the ticks
    memory, began = [], time.process_time()
    minutes = max(4, round(SECONDS / 60))
    for _ in range(minutes):
        run(drivers, host, round(SECONDS / minutes * 100))
        memory.append(resident_megabytes())
    spent = (time.process_time() - began) / SECONDS
    slope = slope_per_hour(np.array(memory), SECONDS)
    record_property("CPU s per simulated s, MB, slope", (spent, memory[-1], slope))
    assert len(host.simulation.vehicles) == ROBOTS
    assert slope < (SLOPE if SECONDS >= SHORT else NOISE * 3600 / SECONDS)


def slope_per_hour(values: Floats, seconds: float) -> float:
    """Return the slope after the first quarter of a run, during which caches fill."""
    hours = np.linspace(0, seconds / 3600, len(values))
    settled = hours >= hours[-1] / 4
    return float(np.polyfit(hours[settled], values[settled], 1)[0])
