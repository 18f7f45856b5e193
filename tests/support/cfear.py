"""CFEAR radar odometry, written from its publication.

It shares no code with what radarsim itself matches scans by. Source: D. Adolfsson, M.
Magnusson, A. Alhashimi, A. J. Lilienthal and H. Andreasson, "CFEAR radarodometry:
conservative filtering for efficient and accurate radar odometry", IROS 2021: the k
strongest bins of each direction over a threshold are compensated for the motion of the
turn; around each cell of a grid their mean and covariance are an oriented surface
point; a turn is registered with the last keyframes, point to line, by a robust loss.
"""

import math
from collections import deque
from collections.abc import Iterable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from radar_odometry import Turn, is_beyond, unroll
from scipy.spatial import cKDTree

from radarsim.geometry import Floats, Pose2
from radarsim.presets.fmcw_settings import FmcwSettings

STRONGEST: Final = 12  # bins of a direction, at most
LEAST_COUNT: Final = 60
NEAREST: Final = 2.5  # m
CELL: Final = 3.5  # m, radius of a surface point, and of correspondences
RESAMPLING: Final = 1.0  # grid cells in CELL
LEAST_POINTS: Final = 6
KEYFRAMES: Final = 4
KEYFRAME_DISTANCE: Final = 1.5  # m
KEYFRAME_ANGLE: Final = math.radians(5)
HUBER: Final = 0.1  # m
NORMALS_AGREE: Final = math.cos(math.radians(30))
ITERATIONS: Final = 8


class Surface(NamedTuple):
    """Oriented surface points; N of them.

    Attributes:
        means: (N, 2) m.
        normals: (N, 2) unit vectors.
        weights: (N,) more for more points in a flatter line.
    """

    means: Floats
    normals: Floats
    weights: Floats

    def moved(self, pose: Pose2) -> "Surface":
        """Return them as seen from where a pose is relative to."""
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        turn = np.array([[c, s], [-s, c]])
        means = self.means @ turn + [pose.x, pose.y]
        return Surface(means, self.normals @ turn, self.weights)


def strongest_bins(
    counts: NDArray[np.uint8], settings: FmcwSettings
) -> tuple[Floats, Floats]:
    """Return the filtered bins: places, (K, 2) m, and shares of the turn, (K,)."""
    first = math.ceil(NEAREST / settings.bin_size)
    image = counts[:, first:].astype(np.int64)
    bins = np.argpartition(-image, STRONGEST, axis=1)[:, :STRONGEST]
    rows = np.repeat(np.arange(len(image)), STRONGEST)
    columns = bins.ravel()
    kept = image[rows, columns] > LEAST_COUNT
    rows, ranges = rows[kept], (columns[kept] + first) * settings.bin_size
    angles = -settings.step * rows
    places = ranges[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return places, rows / settings.azimuths


def surface_points(places: Floats) -> Surface:
    """Return the oriented surface points of places."""
    if not len(places):
        return Surface(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
    cells = np.unique(np.floor(places * RESAMPLING / CELL).astype(np.int64), axis=0)
    tree = cKDTree(places)
    centres = np.array(
        [
            places[near].mean(axis=0)
            for near in tree.query_ball_point((cells + 0.5) * CELL / RESAMPLING, CELL)
            if near
        ]
    )
    found = []
    for near in tree.query_ball_point(centres, CELL):
        if len(near) < LEAST_POINTS:
            continue
        own = places[near]
        values, vectors = np.linalg.eigh(np.cov(own.T) + 1e-6 * np.eye(2))
        # More points, and a thinner line of them, are more certain.
        weight = math.log(values[1] / values[0]) * len(near)
        found.append((*own.mean(axis=0), *vectors[:, 0], weight))
    if not found:
        return Surface(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
    table = np.array(found)
    return Surface(table[:, :2], table[:, 2:4], table[:, 4])


def register(surface: Surface, keyframes: Iterable[Surface], guess: Pose2) -> Pose2:
    """Return the pose at which a surface fits best to keyframes in the map frame."""
    trees = [(each, cKDTree(each.means)) for each in keyframes if len(each.means)]
    pose = guess
    for _ in range(ITERATIONS):
        seen = surface.moved(pose)
        normal, gradient = np.zeros((3, 3)), np.zeros(3)
        for keyframe, tree in trees:
            distance, index = tree.query(seen.means, distance_upper_bound=CELL)
            index = np.where(np.isfinite(distance), index, 0)
            lines = keyframe.normals[index]
            alike = np.abs(np.einsum("ni,ni->n", seen.normals, lines))
            used = np.isfinite(distance) & (alike > NORMALS_AGREE)
            offset = seen.means[used] - keyframe.means[index[used]]
            error = np.einsum("ni,ni->n", offset, lines[used])
            around = seen.means[used] - [pose.x, pose.y]
            slopes = np.column_stack(
                [
                    lines[used],
                    lines[used, 1] * around[:, 0] - lines[used, 0] * around[:, 1],
                ]
            )
            weight = np.minimum(1.0, HUBER / np.maximum(np.abs(error), 1e-9))
            first, second = surface.weights[used], keyframe.weights[index[used]]
            weight *= 2 * np.minimum(first, second) / np.maximum(first + second, 1e-9)
            normal += (slopes * weight[:, None]).T @ slopes
            gradient += slopes.T @ (weight * error)
        step = np.linalg.solve(normal + 1e-6 * np.eye(3), -gradient)
        pose = Pose2(pose.x + step[0], pose.y + step[1], pose.yaw + step[2])
        if np.abs(step).max() < 1e-5:
            break
    return pose


class Cfear:
    """Estimates the motion of a radar, turn by turn.

    Attributes:
        pose: At the end of the last turn.
    """

    def __init__(self, start: Pose2, settings: FmcwSettings) -> None:
        """Begin at a pose."""
        self.pose = start
        self._settings = settings
        self._motion = Pose2(0.0, 0.0)
        self._keyframes: deque[tuple[Pose2, Surface]] = deque(maxlen=KEYFRAMES)

    def step(self, turn: Turn) -> Pose2:
        """Return the pose at the end of the next turn."""
        places, shares = strongest_bins(turn.counts, self._settings)
        last = self.pose
        if self._keyframes:
            surface = surface_points(unroll(places, shares, self._motion))
            maps = [kept for _, kept in self._keyframes]
            self.pose = register(surface, maps, last.compose(self._motion))
            self._motion = self.pose.relative_to(last)
        if not self._keyframes or is_beyond(
            self.pose, self._keyframes[-1][0], KEYFRAME_DISTANCE, KEYFRAME_ANGLE
        ):
            own = surface_points(unroll(places, shares, self._motion))
            self._keyframes.append((self.pose, own.moved(self.pose)))
        return self.pose
