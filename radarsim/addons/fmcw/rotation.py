"""The turning antenna of an FMCW radar on something that moves.

Theory of operation
===================
The antenna turns without a pause. Whenever time has advanced, the directions that it
has passed meanwhile are traced from where the radar is by then, and added to the mean
power of the turn. A direction is received when all others that its main lobe reaches
have been traced, a few sweeps later. So each direction costs its share of a turn, at
the time at which the radar looks there, and the image of a turn is smeared by motion as
that of a real radar is.

What the sidelobes receive is that of the turn before, as the rest of this one is still
to come; so the first turn after the start is not received. A radar that stands still
records what ``FmcwRadar.spectrum`` does, turn by turn.

Sequences: the turns that a radar records as it is driven along a path.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation as Orientation
from scipy.spatial.transform import Slerp

from radarsim.addons.fmcw.beat_signal import Tones
from radarsim.addons.fmcw.mean_power import TurnPower
from radarsim.addons.fmcw.radar import STANDING, FmcwRadar
from radarsim.addons.fmcw.radar_equation import rows_in_beam
from radarsim.addons.fmcw.spectrum import Spectrum
from radarsim.geometry import Floats, Pose3
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import NumberedStreams
from radarsim.scene.scene import Scene


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
    def ends_turn(self) -> bool:
        """Whether the last direction of the turn is among them."""
        end = self.first + len(self.spectrum.angles)
        return end == self.spectrum.settings.azimuths


class _Look(NamedTuple):
    """Directions that were traced together; they count from the start."""

    rows: range
    pose: Pose3
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
        self._traced = 0  # directions since the start
        self._received = radar.settings.azimuths  # those of the first turn are not
        self._power: dict[int, TurnPower] = {}  # of turns that are needed
        self._looks: deque[_Look] = deque()
        self._streams: NumberedStreams | None = None  # of the turn that is received

    def advance(
        self,
        pose: Pose3,
        count: int,
        *,
        boxes: Boxes | None = None,
        carrier_id: int = -1,
        velocity: tuple[float, float, float] = STANDING,
        receives: bool = True,
    ) -> list[Sector]:
        """Turn the antenna, and return what has been received meanwhile.

        Args:
            pose: Pose of the antenna, map frame.
            count: By how many directions it turns.
            boxes: The robots.
            carrier_id: The robot that carries the radar; -1 for none.
            velocity: Of the antenna, m/s, map frame.
            receives: Whether to return that now; else the next call does. It takes less
                time to receive more directions at once.
        """
        azimuths = self.radar.settings.azimuths
        end = self._traced + count
        while self._traced < end:
            turn, first = divmod(self._traced, azimuths)
            rows = range(first, min(first + end - self._traced, azimuths))
            if turn not in self._power:
                self._power[turn] = TurnPower(self.radar.settings)
            power = self._power[turn]
            traced = self.radar.trace(self._scene, pose, boxes, carrier_id, rows)
            tracer = tracer_of(self._scene)
            self.radar.add_power(power, tracer, traced, velocity)
            tones = self.radar.tones(self._scene, pose, boxes, carrier_id, velocity)
            looked = range(self._traced, self._traced + len(rows))
            self._looks.append(_Look(looked, pose, tones.of_rows(rows)))
            self._traced = looked.stop
        if not receives:
            return []
        return self._receive(self._traced - rows_in_beam(self.radar.settings))

    def _receive(self, end: int) -> list[Sector]:
        """Return what is received from directions up to one, counted from the start."""
        sectors = []
        azimuths = self.radar.settings.azimuths
        while self._received < end:
            turn, first = divmod(self._received, azimuths)
            last = min(first + end - self._received, azimuths)
            sectors.append(self._sector(turn, range(first, last)))
            self._received += last - first
        while self._looks and self._looks[0].rows.stop <= self._received:
            self._looks.popleft()
        return sectors

    def _sector(self, turn: int, rows: range) -> Sector:
        if rows.start == 0 or self._streams is None:
            self._streams = NumberedStreams(self._rng)
            self._power.pop(turn - 2, None)
        power, before = self._power[turn], self._power[turn - 1]
        # Where the turn after this one is needed, it has begun.
        after = self._power.get(turn + 1, power)
        mean = power.rows(rows.start, rows.stop, before, after) + before.sidelobes()
        start, end = self._received, self._received + len(rows)
        looks = [k for k in self._looks if k.rows.start < end and k.rows.stop > start]
        tones = _join([look.tones for look in looks])
        pose = looks[0].pose
        spectrum = self.radar.receive(pose, rows, mean, tones, self._streams)
        return Sector(turn - 1, rows.start, spectrum)


def _join(tones: Sequence[Tones]) -> Tones:
    rows, ranges, phases, power = zip(*tones, strict=True)
    return Tones(*map(np.concatenate, (rows, ranges, phases, power)))


STEPS_IN_TURN = 25  # poses at which the antenna looks around


@dataclass(frozen=True, eq=False)
class DrivenPath:
    """Where a radar is at each time; N poses, between which it moves evenly.

    Attributes:
        times: (N,) s, increasing.
        positions: (N, 3) m, map frame.
        orientations: (N, 4) unit quaternions, x, y, z, w.
    """

    times: Floats
    positions: Floats
    orientations: Floats

    @property
    def duration(self) -> float:
        """From the first pose to the last, s."""
        return float(self.times[-1] - self.times[0])

    def poses_at(self, times: Floats) -> list[Pose3]:
        """Return the poses at some times; the first before it, the last after it."""
        inside = np.clip(times, self.times[0], self.times[-1])
        turns = Slerp(self.times, Orientation.from_quat(self.orientations))(inside)
        angles = turns.as_euler("ZYX")
        places = [np.interp(inside, self.times, column) for column in self.positions.T]
        return [
            Pose3(*map(float, (*place, roll, pitch, yaw)))
            for place, (yaw, pitch, roll) in zip(
                zip(*places, strict=True), angles, strict=True
            )
        ]

    def at_heights(self, heights: Floats) -> "DrivenPath":
        """Return the same path at other heights, (N,) m, map frame."""
        return replace(
            self, positions=np.column_stack([self.positions[:, :2], heights])
        )


def read_tum(text: str) -> DrivenPath:
    """Read a path in the format of TUM's tools.

    A line is ``time x y z qx qy qz qw``, in s and m; what begins with # is a comment.

    Raises:
        ValueError: If a line is not such a pose, times do not increase, or there are
            fewer than two poses.
    """
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) != 8 or not np.isfinite(row).all() or not any(row[4:]):
            raise ValueError(
                f"line {number}: {line.strip()[:80]!r}, expected time x y z qx qy qz qw"
            )
        if rows and row[0] <= rows[-1][0]:
            raise ValueError(
                f"line {number}: time {row[0]:g}, expected above {rows[-1][0]:g}"
            )
        rows.append(row)
    if len(rows) < 2:
        raise ValueError(f"{len(rows)} poses, expected at least 2")
    numbers = np.array(rows)
    return DrivenPath(numbers[:, 0], numbers[:, 1:4], numbers[:, 4:])


@dataclass(frozen=True, eq=False)
class RecordedTurn:
    """A turn of a sequence.

    Attributes:
        time: At which it began, s, as of the path.
        spectrum: The turn; its pose is that in its middle.
    """

    time: float
    spectrum: Spectrum

    def tum_line(self) -> str:
        """Return its pose as a line of a path in the format of TUM's tools."""
        pose, settings = self.spectrum.pose, self.spectrum.settings
        middle = self.time + settings.azimuths * settings.sweep_time / 2
        turned = Orientation.from_euler("ZYX", [pose.yaw, pose.pitch, pose.roll])
        numbers = [pose.x, pose.y, pose.z, *turned.as_quat()]
        return " ".join([f"{middle:.6f}", *(f"{each:.6f}" for each in numbers)]) + "\n"


def turns_along(
    radar: FmcwRadar, scene: Scene, path: DrivenPath, rng: np.random.Generator
) -> Iterator[RecordedTurn]:
    """Record all turns that end before a path does.

    Before the path begins the radar stands at its first pose for a turn.

    Args:
        radar: The radar.
        scene: The map.
        path: Where the antenna is, map frame.
        rng: Source of speckle and noise.
    """
    settings = radar.settings
    rotation = Rotation(radar, scene, rng)
    (start,) = path.poses_at(path.times[:1])
    sectors = rotation.advance(start, settings.azimuths)
    step = max(settings.azimuths // STEPS_IN_TURN, 1)
    period = settings.azimuths * settings.sweep_time
    looked, done = 0, 0
    count = int(path.duration / period + 1e-9)
    while done < count:
        seconds = step * settings.sweep_time
        time = path.times[0] + looked * settings.sweep_time
        pose, after = path.poses_at(np.array([time, time + seconds]))
        dx, dy, dz = ((after.position() - pose.position()) / seconds).tolist()
        sectors += rotation.advance(pose, step, velocity=(dx, dy, dz))
        looked += step
        if any(each.turn == done and each.ends_turn for each in sectors):
            began = float(path.times[0] + done * period)
            (middle,) = path.poses_at(np.array([began + period / 2]))
            whole = _join_sectors([each for each in sectors if each.turn == done])
            yield RecordedTurn(began, replace(whole, pose=middle, scene=scene))
            sectors = [each for each in sectors if each.turn > done]
            done += 1


def _join_sectors(sectors: list[Sector]) -> Spectrum:
    """Return a turn from its sectors, in order."""
    parts = [each.spectrum for each in sectors]
    return replace(
        parts[0],
        angles=np.concatenate([part.angles for part in parts]),
        power=np.concatenate([part.power for part in parts]),
        echo_power=np.concatenate([part.echo_power for part in parts]),
    )
