"""Overlap: what keyframes have seen of a place, and whether they saw the same there.

Theory of operation
===================
A place was seen by a keyframe if none of its points in that direction is nearer. Points
of another map that lie in what was seen should be there, too; others say nothing about
whether the maps fit. The share of those that are there tells right from wrong better
than a robust fit does, which forgives what contradicts it.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from radarsim.geometry import Floats, Pose2
from radarsim.mapping.keyframes import Keyframe, moved, turned
from radarsim.mapping.occupancy_grid import Mask

SECTORS: Final = 180  # in which the nearest point of a keyframe bounds what it saw
BEHIND: Final = 0.15  # m behind that point that count as seen
NEAR: Final = 0.1  # m within which two points are the same thing; more far away
STRIDE: Final = 0.5  # m between the keyframes that are looked at


class Agreement(NamedTuple):
    """How well points agree with what keyframes saw.

    Attributes:
        seen: Number of the points in the area that was seen.
        share: Share of these that are near a point of the keyframes; 0 without any.
    """

    seen: int
    share: float

    @property
    def confirmed(self) -> float:
        """Number of the points that are near a point of the keyframes."""
        return self.seen * self.share


class SeenArea:
    """The area that some keyframes have seen, and their points."""

    def __init__(self, keyframes: Sequence[Keyframe]) -> None:
        """Prepare.

        Args:
            keyframes: At least one, each with at least one point.
        """
        self._points = KDTree(
            np.concatenate([moved(each.points.places, each.pose) for each in keyframes])
        )
        self._near = np.concatenate([_near(each.points.places) for each in keyframes])
        chosen = _some(keyframes)
        self._poses = [each.pose for each in chosen]
        self._profiles = [_profile(each.points.places) for each in chosen]

    def sees(self, places: Floats) -> Mask:
        """Return which places, (K, 2) m, are in the area, (K,)."""
        is_seen = np.zeros(len(places), np.bool_)
        for pose, profile in zip(self._poses, self._profiles, strict=True):
            x, y = _relative(places, pose).T
            is_seen |= np.hypot(x, y) < profile[_sectors(x, y)] + BEHIND
        return is_seen

    def compare(self, places: Floats) -> Agreement:
        """Compare the points of another map, (K, 2) m, with what was seen."""
        seen = places[self.sees(places)]
        if not len(seen):
            return Agreement(0, 0.0)
        distances, nearest = self._points.query(seen)
        return Agreement(len(seen), float((distances < self._near[nearest]).mean()))


def _some(keyframes: Sequence[Keyframe]) -> list[Keyframe]:
    """Return keyframes some way apart; those between them see about the same."""
    chosen: list[Keyframe] = []
    for each in keyframes:
        if not chosen or _distance(chosen[-1].pose, each.pose) >= STRIDE:
            chosen.append(each)
    return chosen


def _distance(one: Pose2, other: Pose2) -> float:
    return math.hypot(one.x - other.x, one.y - other.y)


def _near(places: Floats) -> Floats:
    """Return how near to each point of a scan there is none beside it, (K,) m."""
    x, y = places.T
    near: Floats = NEAR + np.hypot(x, y) * math.pi / max(len(places), 1)
    return near


def _profile(places: Floats) -> Floats:
    """Return the distance of the nearest point in each sector, (SECTORS,) m."""
    x, y = places.T
    profile = np.full(SECTORS, math.inf)
    np.minimum.at(profile, _sectors(x, y), np.hypot(x, y))
    profile[np.isinf(profile)] = -math.inf  # nobody knows what is there
    return profile


def _sectors(x: Floats, y: Floats) -> NDArray[np.int64]:
    turns = (np.arctan2(y, x) + math.pi) / (2 * math.pi)
    return (turns * SECTORS).astype(np.int64) % SECTORS


def _relative(places: Floats, pose: Pose2) -> Floats:
    """Return places in the frame of a pose, (K, 2) m."""
    return turned(places - np.array([pose.x, pose.y]), -pose.yaw)
