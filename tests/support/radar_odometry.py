"""Odometry by the targets of a turning radar alone, and how far it drifts.

Theory of operation
===================
A robot drives along a path while the antenna turns, as in a simulation. The targets of
each turn are matched with those of the last few turns; nothing else shows where the
robot is. As in Adolfsson and others, "CFEAR radarodometry" (IROS 2021), targets are the
k strongest bins of each direction, a turn is unrolled by the motion that is estimated,
and compared with a few keyframes by the shapes that their targets form.
"""

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from radarsim.addons.fmcw.radar import FmcwRadar
from radarsim.addons.fmcw.rotation import Rotation
from radarsim.autonomy.mapping.scan_matching import PointMap, ScanPoints, fit
from radarsim.geometry import Floats, Pose2, Pose3
from radarsim.scene.scene import Scene

KEYFRAMES: Final = 4
KEYFRAME_DISTANCE: Final = 0.5  # m
KEYFRAME_ANGLE: Final = 0.1  # rad
TARGETS: Final = 12  # of a direction, at most
# Of echoes across their beam, standard deviation, rad: that of 1.8 degrees, two-way.
SPREAD: Final = math.radians(1.8) / (4 * math.sqrt(math.log(2)))
UNROLLINGS: Final = 2  # where speeds change little from turn to turn
# Of a prediction by the motion of the last turn, m, m and rad.
SIGMA: Final = np.array([0.1, 0.1, 0.1])
TICK: Final = 0.01  # s
CEN_SMOOTHING: Final = 17  # bins
CEN_TRUNCATION: Final = 1.5  # standard deviations, to each side
CEN_THRESHOLD: Final = 3.0  # standard deviations of the noise
CEN_NEAREST: Final = 58  # bins


class Turn(NamedTuple):
    """A turn of a radar that drives.

    Attributes:
        places: (K, 2) m, targets in the frame of the radar as it saw each.
        shares: (K,) share of the turn that had passed then, 0 to 1.
        counts: (A, B) the image.
        end: Pose of the radar when the turn was complete.
    """

    places: Floats
    shares: Floats
    counts: NDArray[np.uint8]
    end: Pose2


class Estimate(NamedTuple):
    """Where the radar was at the end of each turn; N turns.

    Attributes:
        truth: The poses.
        estimated: The poses by odometry; the first one is true.
        peaks: (N,) peaks of each image, as ``cen2018_peaks`` counts them.
    """

    truth: Sequence[Pose2]
    estimated: Sequence[Pose2]
    peaks: NDArray[np.int64]

    @property
    def length(self) -> float:
        """Length of the way, m."""
        places = np.array([(pose.x, pose.y) for pose in self.truth])
        return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())

    @property
    def drift(self) -> float:
        """How far off the last pose is, as a share of the way."""
        end, found = self.truth[-1], self.estimated[-1]
        return math.hypot(end.x - found.x, end.y - found.y) / self.length


class RadarOdometry:
    """Estimates the motion of a radar, turn by turn.

    Attributes:
        pose: At the end of the last turn.
    """

    def __init__(self, start: Pose2, unrollings: int = UNROLLINGS) -> None:
        """Begin at a pose.

        Args:
            start: The pose.
            unrollings: How often a turn is unrolled and matched.
        """
        self.pose = start
        self._unrollings = unrollings
        self._motion = Pose2(0.0, 0.0)  # during the last turn
        self._keyframes: deque[tuple[Pose2, Floats]] = deque(maxlen=KEYFRAMES)
        self._map = PointMap()

    def step(self, turn: Turn) -> Pose2:
        """Return the pose at the end of the next turn."""
        last, motion = self.pose, self._motion
        if self._keyframes:
            for _ in range(self._unrollings):
                points = _scan_points(turn, motion)
                predicted = last.compose(motion)
                self.pose = fit(
                    self._map.table,
                    points,
                    predicted,
                    last.compose(self._motion),
                    SIGMA,
                ).pose
                motion = self.pose.relative_to(last)
        self._motion = motion
        if not self._keyframes or is_beyond(
            self.pose, self._keyframes[-1][0], KEYFRAME_DISTANCE, KEYFRAME_ANGLE
        ):
            self._add_keyframe(unroll(turn.places, turn.shares, motion))
        return self.pose

    def _add_keyframe(self, places: Floats) -> None:
        c, s = math.cos(self.pose.yaw), math.sin(self.pose.yaw)
        turned = places @ np.array([[c, s], [-s, c]]) + [self.pose.x, self.pose.y]
        self._keyframes.append((self.pose, turned))
        self._map = PointMap()
        for _, kept in self._keyframes:
            self._map.add(np.ascontiguousarray(kept))


def unroll(places: Floats, shares: Floats, motion: Pose2) -> Floats:
    """Return places as seen from the end of a turn that had an even motion."""
    left = shares - 1.0  # of the motion, backwards
    yaw = motion.yaw * left
    c, s = np.cos(yaw), np.sin(yaw)
    x, y = places.T
    # Back from the end by what was left of the motion, on the axes of the end.
    back = Pose2(0.0, 0.0).relative_to(motion)
    turned: Floats = np.column_stack([c * x - s * y, s * x + c * y])
    return turned - np.outer(left, (back.x, back.y))


def is_beyond(pose: Pose2, before: Pose2, distance: float, angle: float) -> bool:
    """Return whether a pose is so far from another, m, or so much turned, rad."""
    moved = pose.relative_to(before)
    return math.hypot(moved.x, moved.y) > distance or abs(moved.yaw) > angle


def _scan_points(turn: Turn, motion: Pose2) -> ScanPoints:
    """Return the targets of a turn as seen from its end, if it had been of a motion."""
    places = unroll(turn.places, turn.shares, motion)
    # Beams widen with the range: vectors as long as that make metres of the angle.
    return ScanPoints(places, places, np.zeros_like(places), SPREAD, True)


def turns_along(
    radar: FmcwRadar,
    scene: Scene,
    path: Callable[[float], Pose3],
    seconds: float,
    rng: np.random.Generator,
) -> Iterator[Turn]:
    """Record the turns of a radar that moves, tick by tick.

    Args:
        radar: The radar.
        scene: The map.
        path: Returns the pose of the antenna at a time, s.
        seconds: For how long.
        rng: Source of speckle and noise.
    """
    settings = radar.settings
    rate = round(TICK * settings.rotation_hz * settings.azimuths)
    rotation, before = Rotation(radar, scene, rng), path(0.0)
    parts, images = [], []
    for tick in range(1, round(seconds / TICK)):
        pose = path(tick * TICK)
        x, y, z = ((pose.position() - before.position()) / TICK).tolist()
        looked = rotation.advance(pose, rate, start=before, velocity=(x, y, z))
        before = pose
        for sector in looked:
            images.append(sector.spectrum.counts)
            found = sector.spectrum.detections("k", count=TARGETS)
            share = (sector.first + found.rows) / settings.azimuths
            parts.append((found.ranges, found.angles, share))
            if sector.ends_turn:
                ranges, angles, shares = map(np.concatenate, zip(*parts, strict=True))
                places = ranges[:, None] * np.column_stack(
                    [np.cos(angles), np.sin(angles)]
                )
                end = Pose2(pose.x, pose.y, pose.yaw)
                yield Turn(places, shares, np.concatenate(images), end)
                parts, images = [], []


def follow(turns: Iterator[Turn]) -> Estimate:
    """Estimate the poses of turns; the first one is where the radar begins."""
    truth, estimated, peaks = [], [], []
    odometry: RadarOdometry | None = None
    for turn in turns:
        odometry = odometry or RadarOdometry(turn.end)
        estimated.append(odometry.step(turn))
        truth.append(turn.end)
        peaks.append(cen2018_peaks(turn.counts))
    return Estimate(truth, estimated, np.array(peaks, np.int64))


def cen2018_peaks(
    counts: NDArray[np.uint8],
    smoothing: int = CEN_SMOOTHING,
    nearest: int = CEN_NEAREST,
) -> int:
    """Count the peaks of an image as a common front end of radar odometry does.

    Source: S. H. Cen and P. Newman, "Precise Ego-Motion Estimation with Millimeter-Wave
    Radar under Diverse and Challenging Conditions", ICRA 2018; runs of bins over the
    threshold are one peak.

    Args:
        counts: (A, B).
        smoothing: Standard deviation of the filter along each direction, bins; 17 is
            for bins of 0.04 m, 5 for those of 0.17 m.
        nearest: The first bin in which peaks are looked for.
    """
    above = counts - counts.mean(axis=1, keepdims=True)
    smooth = gaussian_filter1d(
        above, smoothing, axis=1, mode="mirror", truncate=CEN_TRUNCATION
    )
    below = np.where(above < 0, above, 0.0)
    number = np.maximum((above < 0).sum(axis=1, keepdims=True), 1)
    # Twice the mean square, as public implementations have it.
    sigma = np.sqrt(2 * (below**2).sum(axis=1, keepdims=True) / number)
    sigma = np.maximum(sigma, 1e-9)
    is_noise = np.exp(-0.5 * ((above - smooth) / sigma) ** 2)
    is_flat = np.exp(-0.5 * (smooth / sigma) ** 2)
    signal = above * (1 - is_noise) + smooth * (is_noise - is_flat)
    over = signal[:, nearest:] > CEN_THRESHOLD * sigma
    return int((over[:, 1:] & ~over[:, :-1]).sum() + over[:, 0].sum())
