"""Agreement of maps: whether keyframes of both have seen the same of a place.

Theory of operation
===================
A place was seen by a keyframe if none of its points in that direction is nearer. Points
of another map that lie in what was seen should be there, too; others say nothing about
whether the maps fit. The share of those that are there tells right from wrong better
than a robust fit does, which forgives what contradicts it.

Where all rooms are alike, a map that is one room off agrees nearly everywhere. What
tells are the few walls that stand in the middle of floor that others have looked
across (``contradiction``). They count by the room that they take, however many points
they have. A robot is no wall: what its own map has looked through later, or is where a
robot has driven, has moved.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d
from scipy.spatial import KDTree

from radarsim.autonomy.mapping.loop_closure import (
    Keyframe,
    distance,
    joined,
    moved,
    turned,
)
from radarsim.autonomy.mapping.occupancy_grid import Mask
from radarsim.autonomy.mapping.scan_grid import ROBOT_SIZE
from radarsim.geometry import Floats, Pose2

SECTORS: Final = 180  # in which the nearest point of a keyframe bounds what it saw
BEHIND: Final = 0.15  # m behind that point that count as seen
NEAR: Final = 0.1  # m within which two points are the same thing; more far away
STRIDE: Final = 0.5  # m between the keyframes that are looked at
CLEAR: Final = 0.3  # m before what a keyframe saw, where nothing can be
SQUARE: Final = 0.1  # m, side of the squares that contradictions are counted in
MAX_POINTS: Final = 10000  # of a whole map


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
        # Some way apart: those in between have seen about the same.
        chosen: list[Keyframe] = []
        for each in keyframes:
            if not chosen or distance(chosen[-1].pose, each.pose) >= STRIDE:
                chosen.append(each)
        self._poses = [each.pose for each in chosen]
        self._profiles = [_profile(each.points.places) for each in chosen]
        self._clear = [minimum_filter1d(p, 3, mode="wrap") for p in self._profiles]

    def sees(self, places: Floats) -> Mask:
        """Return which places, (K, 2) m, are in the area, (K,)."""
        return self._before(self._profiles, BEHIND, places)

    def looks_through(self, places: Floats) -> Mask:
        """Return which places, (K, 2) m, are well before all that was seen, (K,)."""
        # also beside them, as what is seen past an edge says nothing about the edge
        return self._before(self._clear, -CLEAR, places)

    def contradicts(self, places: Floats) -> Mask:
        """Return which points of another map, (K, 2) m, cannot be there, (K,)."""
        distances, _ = self._points.query(places)
        return np.asarray(self.looks_through(places) & (distances > CLEAR))

    def compare(self, places: Floats) -> Agreement:
        """Compare the points of another map, (K, 2) m, with what was seen."""
        seen = places[self.sees(places)]
        if not len(seen):
            return Agreement(0, 0.0)
        distances, nearest = self._points.query(seen)
        return Agreement(len(seen), float((distances < self._near[nearest]).mean()))

    def _before(
        self, profiles: Sequence[Floats], margin: float, places: Floats
    ) -> Mask:
        is_before = np.zeros(len(places), np.bool_)
        for pose, profile in zip(self._poses, profiles, strict=True):
            x, y = turned(places - np.array([pose.x, pose.y]), -pose.yaw).T
            is_before |= np.hypot(x, y) < profile[_sectors(x, y)] + margin
        return is_before


def contradiction(
    one: Sequence[Keyframe], other: Sequence[Keyframe], robots: Floats
) -> int:
    """Return how much stands where the other map is free, in squares of 0.1 m.

    Args:
        one: Keyframes of a map, at least one.
        other: Those of another map, their poses on the same one.
        robots: Places where robots have been, (M, 2) m, at least one.
    """
    areas = SeenArea(one), SeenArea(other)
    return sum(
        _squares_of(joined(keyframes, Pose2(0, 0), MAX_POINTS).places, *pair, robots)
        for keyframes, pair in ((one, areas), (other, areas[::-1]))
    )


def _squares_of(places: Floats, own: SeenArea, other: SeenArea, robots: Floats) -> int:
    """Return the number of squares with points that another map contradicts."""
    places = places[other.contradicts(places)]
    places = places[KDTree(robots).query(places)[0] > ROBOT_SIZE]
    places = places[~own.looks_through(places)]
    return len(np.unique(np.floor(places / SQUARE), axis=0))


def _near(places: Floats) -> Floats:
    """Return how near to each point of a scan there is none beside it, (K,) m."""
    x, y = places.T
    # Half of the gap between two beams more, at that distance.
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
    # An angle of just pi would be in a sector beyond the last.
    return (turns * SECTORS).astype(np.int64) % SECTORS
