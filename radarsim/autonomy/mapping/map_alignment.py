"""Map alignment: finds where a robot's map is on that of others.

Theory of operation
===================
What a robot has seen from a place of its path is matched with a map of the points of
others, at poses all around the one that the start poses of the robots give. Not how
many points fit decides, since most of them may be where no other robot has been, but
how many of those that the others must have seen are there (``overlap``). A match counts
where nearly all of them are, where it is no corridor, and where no other pose nearby
does about as well, as it would in a row of equal pillars.

From then on the robot's whole map is fitted from time to time, as the maps that overlap
grow.

An alignment is judged by the overlap: what keyframes of both have seen of a place, and
whether they saw the same there.

Theory of operation
===================
A place was seen by a keyframe if none of its points in that direction is nearer. Points
of another map that lie in what was seen should be there, too; others say nothing about
whether the maps fit. The share of those that are there tells right from wrong better
than a robust fit does, which forgives what contradicts it.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from radarsim.autonomy.mapping.loop_closure import (
    MIN_EVENNESS,
    Keyframe,
    KeyframeMap,
    distance,
    joined,
    map_of,
    moved,
    starts_around,
    turned,
)
from radarsim.autonomy.mapping.occupancy_grid import Mask
from radarsim.autonomy.mapping.point_map import Table
from radarsim.autonomy.mapping.scan_matching import best_start, fit
from radarsim.geometry import Floats, Pose2, wrap_angle

SECTORS: Final = 180  # in which the nearest point of a keyframe bounds what it saw
BEHIND: Final = 0.15  # m behind that point that count as seen
NEAR: Final = 0.1  # m within which two points are the same thing; more far away
STRIDE: Final = 0.5  # m between the keyframes that are looked at
MAX_DISTANCE: Final = 1.5  # m by which the first guess may be off
MAX_TURN: Final = 0.2  # rad
FARTHEST: Final = 1.5  # by which a fit may be farther away, in these
VIEW_LENGTH: Final = 3.0  # m of path whose keyframes are matched together
VIEW_POINTS: Final = 600  # of these, that are matched
RIVALS: Final = 2  # other poses that are compared, at most
COARSE: Final = 5  # of so many poses, one is where a rival is looked for
APART: Final = 0.4  # m between poses that are compared, at least
VIEWS: Final = 4  # that are tried in turn
MIN_OVERLAP: Final = 40  # points of a view in the area that others saw, by the guess
MIN_SEEN: Final = 120  # points of a view in the area that others saw
MIN_SHARE: Final = 0.8  # of these that are there; at wrong poses up to 0.75 were
MIN_LEAD: Final = 0.1  # by which that share is above the next pose's
MIN_CONFIRMED: Final = 0.8  # of the points that are there, by a pose as good as another
MAX_POINTS: Final = 3000  # of a whole map
MIN_FITTING: Final = 300  # points of a whole map that have to fit
SIGMA: Final = (0.2, 0.2, 0.03)  # m, m and rad; of a frame that is known


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

    def sees(self, places: Floats) -> Mask:
        """Return which places, (K, 2) m, are in the area, (K,)."""
        is_seen = np.zeros(len(places), np.bool_)
        for pose, profile in zip(self._poses, self._profiles, strict=True):
            x, y = turned(places - np.array([pose.x, pose.y]), -pose.yaw).T
            is_seen |= np.hypot(x, y) < profile[_sectors(x, y)] + BEHIND
        return is_seen

    def compare(self, places: Floats) -> Agreement:
        """Compare the points of another map, (K, 2) m, with what was seen."""
        seen = places[self.sees(places)]
        if not len(seen):
            return Agreement(0, 0.0)
        distances, nearest = self._points.query(seen)
        return Agreement(len(seen), float((distances < self._near[nearest]).mean()))


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


class _Candidate(NamedTuple):
    """A pose at which a view may be, from where it was found, and how it agrees."""

    start: Pose2
    pose: Pose2
    agreement: Agreement


def align(
    reference: Sequence[Keyframe], known: KeyframeMap, guess: Pose2, attempt: int = 0
) -> Pose2 | None:
    """Find where a robot's map is on another one, knowing about where it is.

    Args:
        reference: Keyframes of the other map, their poses on it.
        known: Keyframes of the robot.
        guess: About where the origin of its map is on the other one, within 1.5 m and
            11°, seen from the robot's keyframes.
        attempt: Number of the attempt, from 0: each takes long, and tries one place of
            the path, the one with the greatest overlap by the guess, and others.

    Returns:
        The pose of its origin; None if the maps do not overlap enough to be sure.
    """
    if not reference:
        return None
    area = SeenArea(reference)
    views = _views(known, area, guess)
    if not views:
        return None
    view = views[attempt % min(len(views), VIEWS)]
    there = Keyframe(guess.compose(view.pose), view.points, view.station)
    found = _find(map_of(list(reference)).table, area, there)
    return None if found is None else _frame(found, view.pose)


def _views(known: KeyframeMap, area: SeenArea, guess: Pose2) -> list[Keyframe]:
    """Return what the robot has seen from where, the greatest overlap first."""
    chosen = [known.keyframes[-1]]
    for each in reversed(known.keyframes):
        if chosen[-1].station - each.station >= VIEW_LENGTH / 2:
            chosen.append(each)
    views = []
    for middle in chosen:
        near = [
            each
            for each in known.keyframes
            if abs(each.station - middle.station) <= VIEW_LENGTH / 2
        ]
        points = joined(near, middle.pose, VIEW_POINTS)
        views.append(Keyframe(middle.pose, points, middle.station))
    # Each attempt looks at one view, as each takes long; the most telling ones first.
    overlaps = [
        np.count_nonzero(area.sees(moved(view.points.places, guess.compose(view.pose))))
        for view in views
    ]
    order = np.argsort(overlaps, kind="stable")[::-1]
    return [views[k] for k in order.tolist() if overlaps[k] >= MIN_OVERLAP]


def _find(table: Table, area: SeenArea, view: Keyframe) -> Pose2 | None:
    """Find where a view is, near its pose; None if that is not sure."""
    # Spots count, even where the robot's own poses are found without them: what would
    # be wrong then is found out by its agreement.
    view = replace(view, points=view.points._replace(spots=True))
    starts = starts_around(view.pose, MAX_DISTANCE, MAX_TURN)
    first = _candidate(table, area, view, starts)
    seen, share = first.agreement
    # A fit may run away from where it was looked for.
    turn = abs(wrap_angle(first.pose.yaw - view.pose.yaw))
    is_far = distance(first.pose, view.pose) >= FARTHEST * MAX_DISTANCE
    if seen < MIN_SEEN or share < MIN_SHARE or is_far or turn >= FARTHEST * MAX_TURN:
        return None
    if _evenness(table, area, view, first.pose) < MIN_EVENNESS:
        return None
    # In a row of equal pillars another pose does as well, and no choice is sure.
    starts = _away(starts, first)[::COARSE]
    for _ in range(RIVALS):
        if not len(starts):
            break
        rival = _candidate(table, area, view, starts)
        starts = _away(starts, rival)
        # As good: nearly as many points are there, and nearly as large a share.
        is_as_good = rival.agreement.share > share - MIN_LEAD and (
            rival.agreement.confirmed > MIN_CONFIRMED * first.agreement.confirmed
        )
        if is_as_good and distance(rival.pose, first.pose) > APART:
            return None
    return first.pose


def _candidate(
    table: Table, area: SeenArea, view: Keyframe, starts: Floats
) -> _Candidate:
    """Return the best pose of a view that is near any of some, (S, 3)."""
    points = view.points
    start = Pose2(*starts[best_start(table, points, starts)].tolist())
    sigma = np.array([MAX_DISTANCE, MAX_DISTANCE, MAX_TURN])
    found = fit(table, points, start, view.pose, sigma)
    agreement = area.compare(moved(points.places, found.pose))
    return _Candidate(start, found.pose, agreement)


def _away(starts: Floats, candidate: _Candidate) -> Floats:
    """Return the poses, (S, 3), that are apart from one and from where it began."""
    for pose in (candidate.start, candidate.pose):
        distances = np.hypot(starts[:, 0] - pose.x, starts[:, 1] - pose.y)
        starts = starts[distances > APART]
    return starts


def _evenness(table: Table, area: SeenArea, view: Keyframe, pose: Pose2) -> float:
    """Return the evenness of a view at a pose, by what others have seen alone.

    What is beyond a thin wall may continue the walls on this side of it.
    """
    points = view.points
    seen = area.sees(moved(points.places, pose))
    # Kernels are compiled for contiguous arrays.
    columns = (np.ascontiguousarray(rows[seen]) for rows in points[:3])
    places, along, normals = columns
    points = points._replace(places=places, along=along, normals=normals)
    return fit(table, points, pose, pose, np.array(SIGMA)).evenness


def refine(
    reference: Sequence[Keyframe], known: KeyframeMap, frame: Pose2
) -> Pose2 | None:
    """Fit a robot's whole map to another one, on which it is known.

    Args:
        reference: Keyframes of the other map, their poses on it.
        known: Keyframes of the robot.
        frame: Pose of its origin on the other map.

    Returns:
        A better pose; None if the maps do not overlap enough.
    """
    own = known.keyframes[-1].pose
    points = joined(known.keyframes, own, MAX_POINTS)
    start = frame.compose(own)
    found = fit(map_of(list(reference)).table, points, start, start, np.array(SIGMA))
    # A number, not a share: most of the map may be where no other robot has been.
    fitting = found.inliers * len(points.places)
    if fitting < MIN_FITTING or found.evenness < MIN_EVENNESS:
        return None
    return _frame(found.pose, own)


def _frame(pose: Pose2, own: Pose2) -> Pose2:
    """Return the pose of a map's origin by the pose of a robot on another map."""
    return pose.compose(Pose2(0.0, 0.0).relative_to(own))
