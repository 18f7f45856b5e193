"""The turning antenna of an FMCW radar on something that moves.

Theory of operation
===================
The antenna turns without a pause. The directions that it has passed since something was
last received are traced together, each from where the radar was then, and added to the
echoes of the turn. A direction is received when all others that its main lobe reaches
have been traced, a few sweeps later. So each direction costs its share of a turn, at
the time at which the radar looks there, and the image of a turn is smeared by motion as
that of a real radar is.

What the sidelobes receive is that of the turn before, as the rest of this one is still
to come; so the first turn after the start is not received. A radar that stands still
records what ``FmcwRadar.spectrum`` does, turn by turn.

A ``TurnReceiver`` adds the detector of a scanner. Nothing here reads the simulation, so
that a thread can do it while time goes on.
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
    """Neighbouring directions of a turn.

    Attributes:
        turn: Number of the turn, from 0.
        first: The first direction.
        spectrum: What is received from them, from the pose at which the radar looked
            into the first.
    """

    turn: int
    first: int
    spectrum: Spectrum

    @property
    def rows(self) -> range:
        """The directions."""
        return range(self.first, self.first + len(self.spectrum.angles))

    @property
    def ends_turn(self) -> bool:
        """Whether the last direction of the turn is among them."""
        return self.rows.stop == self.spectrum.settings.azimuths


def join_sectors(sectors: Iterable[Sector]) -> Spectrum:
    """Return a turn of its sectors, from the pose at which it began."""
    parts = [each.spectrum for each in sectors]
    return replace(
        parts[0],
        angles=np.concatenate([part.angles for part in parts]),
        power=np.concatenate([part.power for part in parts]),
        echo_power=np.concatenate([part.echo_power for part in parts]),
        radial_velocity=np.concatenate([part.radial_velocity for part in parts]),
    )


class _TracedLook(NamedTuple):
    """Directions that were traced together; they count from the start."""

    rows: range
    poses: list[Pose3]  # the antenna's after the step that passed each
    view: Viewpoints
    tones: Tones


class Rotation:
    """The turning antenna of a radar.

    Attributes:
        radar: The radar.
    """

    def __init__(
        self, radar: FmcwRadar, scene: Scene, rng: np.random.Generator
    ) -> None:
        """Create an antenna that looks straight ahead.

        Args:
            radar: The radar.
            scene: The map.
            rng: Source of speckle and noise, of which each turn has a child, as each
                ``FmcwRadar.spectrum`` has: what others draw from it stays the same.
        """
        self.radar = radar
        self._scene = scene
        self._rng = rng
        self._key = fixed_number(rng)  # of speckle
        self._passed: list[tuple[Viewpoints, Pose3]] = []  # what is not yet traced
        self._traced = 0  # directions since the start
        self._received = radar.settings.azimuths  # those of the first turn are not
        self._echoes: dict[int, TurnEchoes] = {}  # of turns that are needed
        self._looks: deque[_TracedLook] = deque()
        self._streams: NumberedStreams | None = None  # of the turn that is received

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
        """Turn the antenna, and return what has been received meanwhile.

        Args:
            pose: Pose of the antenna after it, map frame.
            count: By how many directions it turns.
            start: Its pose as it looks into the first of them; it moves evenly to
                ``pose``. None for that pose.
            boxes: The robots.
            carrier_id: The robot that carries the radar; -1 for none.
            velocity: Of the antenna, m/s, map frame.
            receives: Whether to trace and return that now; else the next call does,
                with its robots. It takes less time for more directions at once.
        """
        azimuths = self.radar.settings.azimuths
        begin = self._traced + sum(len(view.times) for view, _ in self._passed)
        # The turn before the first that is received has the number -1.
        numbers = np.arange(begin, begin + count) - azimuths
        times = np.asarray(self.radar.settings.sweep_time * numbers, np.float64)
        view = moving_viewpoints(start or pose, pose, times, velocity)
        self._passed.append((view, pose))
        if not receives:
            return []
        self._trace_passed(boxes, carrier_id)
        sectors = []
        # A direction is complete when those that its main lobe reaches are traced.
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
        """Trace all directions that have been passed."""
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
        """Add the echoes of directions to a turn; return those of points."""
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
        # Where the turn after this one is needed, it has begun.
        after = self._echoes.get(turn + 1, own)
        echoes = own.rows(rows.start, rows.stop, before, after)
        # The looks into these directions: of several ticks, if they are received late.
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


# The number of a turn, as of its sectors, the targets in it, and the settings that the
# scanner had when it began.
FoundTurn: TypeAlias = tuple[int, Targets, SensorSettings]
Received: TypeAlias = tuple[list[Sector], FoundTurn | None]


class TurnReceiver(Rotation):
    """The antenna of a radar, and the detector of its scanner."""

    def __init__(
        self, radar: FmcwRadar, scene: Scene, rng: np.random.Generator
    ) -> None:
        """Create an antenna that looks straight ahead; arguments as of ``Rotation``."""
        super().__init__(radar, scene, rng)
        # Of the turn that is received; it has the settings with which it began.
        self._settings: SensorSettings | None = None
        self._targets: list[Targets] = []

    def receive(
        self, settings: SensorSettings, is_recorded: bool, /, *args: Any, **kwargs: Any
    ) -> Received:
        """Turn the antenna, and detect targets in what has been received meanwhile.

        Args:
            settings: Settings of the scanner.
            is_recorded: Whether the counts of the directions are needed.
            args: As of ``advance``.
            kwargs: As of ``advance``.

        Returns:
            The directions, and what was found in the turn that they complete, if they
            do, and the scanner has a detector.
        """
        found = None
        sectors = self.advance(*args, **kwargs)
        for sector in sectors:
            if is_recorded:
                _ = sector.spectrum.counts  # computed once, here
            if sector.first == 0:
                self._settings = settings if settings.has_detector else None
                self._targets.clear()
            if self._settings is None:
                continue
            self._targets.append(find_targets(sector.spectrum, self._settings))
            if sector.ends_turn:
                found = sector.turn, join_targets(self._targets), self._settings
        return sectors, found
