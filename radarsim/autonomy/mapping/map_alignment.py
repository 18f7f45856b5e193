"""Map alignment: finds where a robot's map is on that of others.

Theory of operation
===================
What a robot has seen from a place of its path is matched with a map of the points of
others, at all poses where it can be if the robot's start pose is off by up to 1.5 m and
11°, and at no others. Not how many points fit decides, since most of them may be where
no other robot has been, but how many of those that the others must have seen are there
(``map_agreement``). A match counts where nearly all of them are, where it is no
corridor, where the rest of both maps does not contradict it, and where no other pose
nearby does about as well, as it would in a row of equal pillars.

From then on the robot's whole map is fitted from time to time, as the maps that overlap
grow. Where they come to contradict each other, the match was wrong.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from radarsim.autonomy.mapping.loop_closure import (
    MIN_EVENNESS,
    Keyframe,
    KeyframeMap,
    distance,
    joined,
    map_of,
    moved,
    starts_around,
)
from radarsim.autonomy.mapping.map_agreement import Agreement, SeenArea, contradiction
from radarsim.autonomy.mapping.scan_matching import best_start, fit
from radarsim.geometry import Floats, Pose2, wrap_angle

MAX_DISTANCE: Final = 1.5  # m by which a start pose may be off
MAX_TURN: Final = 0.2  # rad
CANDIDATES: Final = 3  # poses that are looked at where others prove to be wrong
MAX_CONTRADICTION: Final = 10  # squares of 0.1 m of a map that contradict another one
VIEW_LENGTH: Final = 3.0  # m of path whose keyframes are matched together
VIEW_POINTS: Final = 600  # of these, that are matched
WHOLE_POINTS: Final = 1500  # of a whole map, that are matched
RIVALS: Final = 2  # other poses that are compared, at most
COARSE: Final = 5  # of so many poses, one is where a rival is looked for
APART: Final = 0.4  # m between poses that are compared, at least
VIEWS: Final = 4  # that are tried in turn
MIN_OVERLAP: Final = 40  # points of a view in the area that others saw, by the guess
MIN_SEEN: Final = 120  # points of a view in the area that others saw
MIN_SHARE: Final = 0.8  # of these that are there; at wrong poses up to 0.75 were
MIN_LEAD: Final = 0.1  # by which that share is above the next pose's
MIN_CONFIRMED: Final = 0.8  # of the points that are there, by a pose as good as another
# The same of a whole map: in a row of equal rooms it may lie on more of the others'
# maps where it is wrong.
WHOLE_CONFIRMED: Final = 0.5
MAX_POINTS: Final = 3000  # of a whole map
MIN_FITTING: Final = 300  # points of a whole map that have to fit
SIGMA: Final = (0.2, 0.2, 0.03)  # m, m and rad; of a frame that is known


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
        guess: About where the origin of its map is on the other one: at the robot's
            start within 1.5 m and 11°.
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
    search = _Search(reference, area, known, guess, view)
    found = search.find()
    return None if found is None else _frame(found, view.pose)


def is_sole(
    reference: Sequence[Keyframe], known: KeyframeMap, frame: Pose2, guess: Pose2
) -> bool:
    """Return whether a robot's whole map fits nowhere else as well; as for ``align``.

    What was found when maps were small may be one of several places by now.
    """
    own = known.keyframes[-1]
    points = joined(known.keyframes, own.pose, WHOLE_POINTS)
    view = Keyframe(own.pose, points, own.station)
    search = _Search(reference, SeenArea(reference), known, guess, view)
    return search.is_sole(frame.compose(own.pose))


def is_allowed(frame: Pose2, known: KeyframeMap, guess: Pose2) -> bool:
    """Return whether a robot's start is within 1.5 m and 11° of where it should be."""
    start = known.keyframes[0].pose
    off = distance(frame.compose(start), guess.compose(start))
    return off <= MAX_DISTANCE and abs(wrap_angle(frame.yaw - guess.yaw)) <= MAX_TURN


def fits(
    reference: Sequence[Keyframe],
    known: KeyframeMap,
    frame: Pose2,
    robots: Sequence[Keyframe] = (),
) -> bool:
    """Return whether a robot's map, at a pose of its origin, contradicts no other.

    Args:
        reference: Keyframes of the other map, their poses on it.
        known: Keyframes of the robot.
        frame: Pose of its origin on the other map.
        robots: Keyframes of further robots that the two may have seen.
    """
    own = placed(known, frame)
    places = [(at.pose.x, at.pose.y) for at in (*reference, *own, *robots)]
    return contradiction(reference, own, np.array(places)) < MAX_CONTRADICTION


def placed(known: KeyframeMap, frame: Pose2) -> list[Keyframe]:
    """Return a robot's keyframes on the map where its origin has a pose."""
    return [
        Keyframe(frame.compose(each.pose), each.points, each.station)
        for each in known.keyframes
    ]


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


class _Search:
    """Search for the pose of what a robot has seen from a place."""

    def __init__(
        self,
        reference: Sequence[Keyframe],
        area: SeenArea,
        known: KeyframeMap,
        guess: Pose2,
        view: Keyframe,
    ) -> None:
        self._reference, self._area, self._known = reference, area, known
        self._guess, self._own = guess, view.pose
        self._table = map_of(list(reference)).table
        # Spots count, even where the robot's own poses are found without them: what
        # would be wrong then is found out by its agreement.
        points = view.points._replace(spots=True)
        self._view = Keyframe(guess.compose(view.pose), points, view.station)

    def find(self) -> Pose2 | None:
        """Return where the view is; None if that is not sure."""
        starts = self._starts()
        first = self._candidate(starts)
        starts = starts[::COARSE]
        for _ in range(CANDIDATES):
            starts = _away(starts, first)
            seen, share = first.agreement
            if seen < MIN_SEEN or share < MIN_SHARE:
                return None
            if self._is_possible(first.pose):
                break
            if not len(starts):
                return None
            first = self._candidate(starts)
        else:
            return None
        if self._evenness(first.pose) < MIN_EVENNESS:
            return None
        is_sure = not self._has_rival(first, starts, MIN_CONFIRMED)
        return first.pose if is_sure else None

    def is_sole(self, pose: Pose2) -> bool:
        """Return whether no other pose of the view does about as well as this one."""
        places = moved(self._view.points.places, pose)
        first = _Candidate(pose, pose, self._area.compare(places))
        starts = _away(self._starts()[::COARSE], first)
        return not self._has_rival(first, starts, WHOLE_CONFIRMED)

    def _has_rival(
        self, first: _Candidate, starts: Floats, min_confirmed: float
    ) -> bool:
        # In a row of equal pillars another pose does as well, and no choice is sure.
        for _ in range(RIVALS):
            if not len(starts):
                break
            rival = self._candidate(starts)
            starts = _away(starts, rival)
            is_as_good = _is_as_good(rival, first, min_confirmed)
            if is_as_good and self._is_possible(rival.pose):
                return True
        return False

    def _starts(self) -> Floats:
        """Return where the view may be, (S, 3), by where the robot may have started."""
        start = self._known.keyframes[0].pose
        there = self._guess.compose(start)
        starts = starts_around(there, MAX_DISTANCE, MAX_TURN)
        x, y, yaw = starts.T
        to = self._own.relative_to(start)
        c, s = np.cos(yaw), np.sin(yaw)
        return np.column_stack(
            [x + c * to.x - s * to.y, y + s * to.x + c * to.y, yaw + to.yaw]
        )

    def _candidate(self, starts: Floats) -> _Candidate:
        """Return the best pose of the view that is near any of some, (S, 3)."""
        points = self._view.points
        start = Pose2(*starts[best_start(self._table, points, starts)].tolist())
        sigma = np.array([MAX_DISTANCE, MAX_DISTANCE, MAX_TURN])
        found = fit(self._table, points, start, self._view.pose, sigma)
        agreement = self._area.compare(moved(points.places, found.pose))
        return _Candidate(start, found.pose, agreement)

    def _is_possible(self, pose: Pose2) -> bool:
        """Return whether the start allows a pose, and all that is known fits there."""
        frame = _frame(pose, self._own)
        # A fit may run away from where it was looked for.
        return is_allowed(frame, self._known, self._guess) and fits(
            self._reference, self._known, frame
        )

    def _evenness(self, pose: Pose2) -> float:
        """Return the evenness of the view at a pose, by what others have seen alone.

        What is beyond a thin wall may continue the walls on this side of it.
        """
        points = self._view.points
        seen = self._area.sees(moved(points.places, pose))
        # Kernels are compiled for contiguous arrays.
        columns = (np.ascontiguousarray(rows[seen]) for rows in points[:3])
        places, along, normals = columns
        points = points._replace(places=places, along=along, normals=normals)
        return fit(self._table, points, pose, pose, np.array(SIGMA)).evenness


def _is_as_good(rival: _Candidate, first: _Candidate, min_confirmed: float) -> bool:
    """Return whether another pose agrees nearly as well as the first one."""
    share, confirmed = first.agreement.share, first.agreement.confirmed
    return (
        rival.agreement.share > share - MIN_LEAD
        and rival.agreement.confirmed > min_confirmed * confirmed
        and distance(rival.pose, first.pose) > APART
    )


def _away(starts: Floats, candidate: _Candidate) -> Floats:
    """Return the poses, (S, 3), that are apart from one and from where it began."""
    for pose in (candidate.start, candidate.pose):
        distances = np.hypot(starts[:, 0] - pose.x, starts[:, 1] - pose.y)
        starts = starts[distances > APART]
    return starts


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
