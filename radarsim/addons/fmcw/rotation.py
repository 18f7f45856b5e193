"""The rotating antenna of an FMCW radar that moves while it records.

Theory of operation
===================
The antenna rotates continuously. The azimuths that it has passed since the last call
are traced together, each from its own pose, and added to the echoes of the revolution.
The spectrum of an azimuth is computed when all azimuths that its main lobe covers have
been traced, a few sweeps later. So the computing time is spread evenly over a
revolution, and motion distorts its image as in a real radar.

The sidelobes receive the echoes of the previous revolution, since the current one is
not complete; so the first revolution after the start is not received. A radar that does
not move records the same revolutions as ``FmcwRadar.spectrum``.

A ``TurnReceiver`` adds the detector of a scanner. This module does not access the
simulation, so a thread can run it while simulated time advances.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from radarsim.addons.fmcw.antenna import (
    STANDING,
    Velocity,
    Viewpoints,
    moving_viewpoints,
    rows_in_beam,
)
from radarsim.addons.fmcw.beat_signal import NumberedStreams, Tones, join_tones
from radarsim.addons.fmcw.radar import FmcwRadar
from radarsim.addons.fmcw.spectrum import Spectrum
from radarsim.addons.fmcw.targets import find_targets, join_targets
from radarsim.addons.fmcw.turn_echoes import TurnEchoes
from radarsim.geometry import Pose3
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.raycast.rays import Boxes
from radarsim.rng import fixed_number
from radarsim.scene.scene import Scene
from radarsim.sensors.scan import Targets


class Sector(NamedTuple):
    """The received data of consecutive azimuths of a revolution.

    Attributes:
        turn: Number of the revolution, from 0.
        first: Index of the first azimuth.
        spectrum: Spectrum of the azimuths, with the pose at the first azimuth.
    """

    turn: int
    first: int
    spectrum: Spectrum

    @property
    def rows(self) -> range:
        """Indices of the sector's azimuths in the revolution."""
        return range(self.first, self.first + len(self.spectrum.angles))

    @property
    def ends_turn(self) -> bool:
        """Whether the sector contains the last azimuth of the revolution."""
        return self.rows.stop == self.spectrum.settings.azimuths


def join_sectors(sectors: Iterable[Sector]) -> Spectrum:
    """Join the sectors of a revolution to one spectrum, with the pose at its start."""
    parts = [each.spectrum for each in sectors]
    return replace(
        parts[0],
        angles=np.concatenate([part.angles for part in parts]),
        power=np.concatenate([part.power for part in parts]),
        echo_power=np.concatenate([part.echo_power for part in parts]),
        radial_velocity=np.concatenate([part.radial_velocity for part in parts]),
    )


class _TracedLook(NamedTuple):
    """Azimuths that were traced together."""

    rows: range  # numbers of the azimuths since the start
    poses: list[Pose3]  # poses of the antenna at the end of each azimuth's tick
    view: Viewpoints
    tones: Tones


class Rotation:
    """The rotating antenna of an FMCW radar.

    Attributes:
        radar: The radar.
    """

    def __init__(
        self, radar: FmcwRadar, scene: Scene, rng: np.random.Generator
    ) -> None:
        """Create an antenna that points straight ahead.

        Args:
            radar: The radar.
            scene: The map.
            rng: Source of speckle and noise. No numbers are drawn from it; as in
                ``FmcwRadar.spectrum``, a generator is spawned for each revolution.
        """
        self.radar = radar
        self._scene = scene
        self._rng = rng
        self._key = fixed_number(rng)  # key of the speckle
        self._passed: list[tuple[Viewpoints, Pose3]] = []  # azimuths not yet traced
        self._traced = 0  # number of traced azimuths since the start
        self._received = radar.settings.azimuths  # skips the first revolution
        self._echoes: dict[int, TurnEchoes] = {}  # echoes of the needed revolutions
        self._looks: deque[_TracedLook] = deque()
        self._streams: NumberedStreams | None = None  # noise of the current revolution

    def advance(
        self,
        pose: Pose3,
        count: int,
        *,
        start: Pose3 | None = None,
        boxes: Boxes | None = None,
        carrier_id: int = -1,
        velocity: Velocity = STANDING,
        receives: bool = True,
    ) -> list[Sector]:
        """Rotate the antenna, and return the data of azimuths that are now complete.

        Args:
            pose: Pose of the antenna after the rotation, map frame.
            count: Number of azimuths by which the antenna rotates.
            start: Pose at the first of these azimuths, from which the antenna moves to
                ``pose`` at constant speed; None for ``pose``.
            boxes: The boxes of robots.
            carrier_id: Id of the robot that carries the radar; -1 for none.
            velocity: Velocity of the antenna, m/s, map frame.
            receives: Whether to trace the azimuths now. Otherwise the next call traces
                them, with its boxes; it is faster to trace many azimuths together.
        """
        azimuths = self.radar.settings.azimuths
        begin = self._traced + sum(len(view.times) for view, _ in self._passed)
        # The first revolution, of which no data is returned, has the number -1.
        numbers = np.arange(begin, begin + count) - azimuths
        times = np.asarray(self.radar.settings.sweep_time * numbers, np.float64)
        view = moving_viewpoints(start or pose, pose, times, velocity)
        self._passed.append((view, pose))
        if not receives:
            return []
        self._trace_passed(boxes, carrier_id)
        sectors = []
        # An azimuth is complete when all azimuths in its main lobe are traced.
        last = self._traced - rows_in_beam(self.radar.settings)
        while self._received < last:
            turn, first = divmod(self._received, azimuths)
            stop = min(first + last - self._received, azimuths)
            spectrum = self._receive(turn, range(first, stop))
            sectors.append(Sector(turn - 1, first, spectrum))
            self._received += stop - first
        while self._looks and self._looks[0].rows.stop <= self._received:
            self._looks.popleft()
        return sectors

    def _trace_passed(self, boxes: Boxes | None, carrier_id: int) -> None:
        """Trace all azimuths that the antenna has passed since the last call."""
        views = zip(*(view for view, _ in self._passed), strict=True)
        view = Viewpoints._make(map(np.concatenate, views))
        poses = [pose for seen, pose in self._passed for _ in seen.times]
        self._passed.clear()
        while poses:
            turn, first = divmod(self._traced, self.radar.settings.azimuths)
            rows = range(first, self.radar.settings.azimuths)[: len(poses)]
            looked = range(self._traced, self._traced + len(rows))
            seen = view.of(slice(len(rows)))
            tones = self._trace(turn, rows, seen, boxes, carrier_id)
            self._looks.append(_TracedLook(looked, poses[: len(rows)], seen, tones))
            self._traced = looked.stop
            view, poses = view.of(slice(len(rows), None)), poses[len(rows) :]

    def _trace(
        self,
        turn: int,
        rows: range,
        view: Viewpoints,
        boxes: Boxes | None,
        carrier_id: int,
    ) -> Tones:
        """Trace azimuths: add surface echoes to the revolution; return point echoes."""
        radar, scene = self.radar, self._scene
        if turn not in self._echoes:
            self._echoes[turn] = radar.new_turn(scene)
        own = self._echoes[turn]
        radar.add_echoes(own, scene, view, rows, self._key, boxes, carrier_id)
        return radar.tones(scene, view, rows, boxes, carrier_id)

    def _receive(self, turn: int, rows: range) -> Spectrum:
        if rows.start == 0 or self._streams is None:
            self._streams = NumberedStreams(self._rng)
            self._echoes.pop(turn - 2, None)
        own, before = self._echoes[turn], self._echoes[turn - 1]
        # The last azimuths of a revolution also need echoes of the next revolution,
        # which has begun by then.
        after = self._echoes.get(turn + 1, own)
        echoes = own.rows(rows.start, rows.stop, before, after)
        # Several calls of ``_trace`` may have traced these azimuths and others.
        start, end = self._received, self._received + len(rows)
        looks = [k for k in self._looks if k.rows.start < end and k.rows.stop > start]
        offset = start - looks[0].rows.start
        views = zip(*(look.view for look in looks), strict=True)
        view = Viewpoints._make(map(np.concatenate, views)).of(
            slice(offset, offset + len(rows))
        )
        self.radar.add_sidelobes(echoes, before, rows, view, self._key)
        tones = join_tones(look.tones for look in looks)
        pose = looks[0].poses[offset]
        return self.radar.receive(pose, rows, view, echoes, tones, self._streams)


# The number and the targets of a revolution, and the scanner's settings when the
# revolution began.
FoundTurn: TypeAlias = tuple[int, Targets, SensorSettings]
Received: TypeAlias = tuple[list[Sector], FoundTurn | None]


class TurnReceiver(Rotation):
    """The rotating antenna of a radar whose scanner detects targets."""

    def __init__(
        self, radar: FmcwRadar, scene: Scene, rng: np.random.Generator
    ) -> None:
        """Create an antenna that points straight ahead; see ``Rotation``."""
        super().__init__(radar, scene, rng)
        # Settings of the scanner when the revolution began, which apply until its end;
        # None without detector.
        self._settings: SensorSettings | None = None
        self._targets: list[Targets] = []

    def receive(
        self, settings: SensorSettings, is_recorded: bool, /, *args: Any, **kwargs: Any
    ) -> Received:
        """Rotate the antenna, and detect targets in the azimuths that are now complete.

        Args:
            settings: Settings of the scanner.
            is_recorded: Whether the counts of the azimuths are needed.
            args: Arguments of ``advance``.
            kwargs: Keyword arguments of ``advance``.

        Returns:
            The received azimuths, and the targets of the revolution that they complete;
            None if they complete none, or the scanner has no detector.
        """
        found = None
        sectors = self.advance(*args, **kwargs)
        for sector in sectors:
            if is_recorded:
                _ = sector.spectrum.counts  # computed in this thread, and cached
            if sector.first == 0:
                self._settings = settings if settings.has_detector else None
                self._targets.clear()
            if self._settings is None:
                continue
            self._targets.append(find_targets(sector.spectrum, self._settings))
            if sector.ends_turn:
                found = sector.turn, join_targets(self._targets), self._settings
        return sectors, found
