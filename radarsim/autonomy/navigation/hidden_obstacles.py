"""Obstacles that the newest scan does not show: what was touched, and what vanished.

Theory of operation
===================
A beam that meets a mirror goes on elsewhere, and ends in a place that seems to be
behind the mirror. So what seems to stand before a mirror stands there, and what seems
to be behind it may not. A robot drives into things that it cannot see, and its touch
sensors report a touch, but not its place. That is on the side of the footprint that
led: its points moved outward.

A box as wide as that part of the footprint is kept there, in the map frame. From then
on beams end at it, and what they showed behind it does not count. Where two boxes are
so near to each other that the robot does not fit between them, beams end there as well.
So all that steers by scans treats what was touched as it treats what it sees.

The robot goes back the way it came, which was free, until all that it sees or has
touched is as far away as the safety distance. It keeps nothing if it stood: then
something has driven into it, and will drive away. Along a mirror the way back leads
along it. So where that ends, it takes the motion that leads its centre away and its
footprint past all that it sees or has touched. It does the same instead of a motion
that would press its footprint against what it sees or has touched, such as a turn at
it: nothing is touched twice. If it touches something on that way, it goes back on that.

In a mirror that it faces it sees itself come as it comes. It may stop before its image,
and stand there for good; in a gap whose sides are mirrors it may turn to and fro. So
where it gets nowhere it takes what it faces for touched.

The end of a plate is thin, and beams pass by it: one scan shows it, and the next
one does not. Where the plate is a mirror, what beams show instead is far away. A robot
that steers by each scan alone would turn away from the end in one and on towards it in
the next, until it touches it.

So what a scan has shown near the robot, and the next one looks through, is kept for a
few seconds: beams end there as if they had met it. What has moved is not kept: it is
seen next to its place, or a little farther away.
"""

import math
from collections import deque
from dataclasses import replace
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.autonomy.navigation.control import MOVED, STOP, Twist
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.navigation.open_directions import HORIZON
from radarsim.geometry import Floats, Pose2, wrap_angle

DEPTH: Final = 0.1  # m; of a box, so that it is seen from its end, too
LEAST_WIDTH: Final = 0.2  # m; of a box, so that bumpers notice it
STOOD: Final = 0.5  # s without a command to move, after which the robot stood
HELD: Final = 8.0  # s for which it gets nowhere and does not wait
LONGEST_WAY_BACK: Final = 1.0  # m
LEAST_SPEED: Final = 0.02  # m/s; less is no motion
LEAST_TURN: Final = 0.05  # rad/s
_MOTIONS: Final = 200  # that are kept
_POINTS: Final = 5  # on each side of the footprint
_LEADING: Final = 0.5  # of the highest outward speed, above which a point may have led
_CLOSE: Final = 0.02  # m from the footprint to a box, within which it may touch that
_SOON: Final = (0.15, 0.3)  # s ahead at which a motion is judged that a bug decided on
_AHEAD: Final = (0.25, 0.5, 0.75, 1.0)  # s; likewise, one that leads away
_GAIN: Final = 0.01  # m that this has to lead away
_SPEEDS: Final = (0.2, -0.2)  # m/s of motions that may
_TURNS: Final = (0.0, 0.1, -0.1, 0.2, -0.2, 0.4, -0.4, 0.8, -0.8)  # rad/s, likewise
_SAMPLE: Final = 0.05  # m between two points of a box
_SAME: Final = 0.6  # m from a box within which the same thing was touched again
_PART: Final = 0.15  # m from the point that is nearest to the box, likewise
KEPT_FOR: Final = 3.0  # s for which what has vanished is kept
REACH: Final = 0.65  # m; beyond, a pole may be between two beams for long
_SAME_PLACE: Final = 0.1  # m within which what has vanished is the same
_HALF: Final = 0.05  # m; half the side of the box that is kept of it

Points: TypeAlias = NDArray[np.complex128]  # x + iy, m


class TouchedPlaces:
    """Boxes where something was touched, and what scans show with them."""

    def __init__(self, gap: float) -> None:
        """Create it without boxes.

        Args:
            gap: Widest gap between two boxes through which the robot does not fit, m.
        """
        self._gap = gap
        self._corners: Points = np.zeros((0, 4), np.complex128)  # map frame
        self._walls: Points = np.zeros((0, 2), np.complex128)  # both ends of each

    def __len__(self) -> int:
        return len(self._corners)

    def add(self, corners: Points) -> None:
        """Add a box by its corners in turn, (4,), map frame."""
        walls = [np.column_stack([corners, np.roll(corners, -1)])]
        for other in self._corners:
            gaps = np.abs(corners[:, None] - other)
            i, j = np.unravel_index(gaps.argmin(), gaps.shape)
            if gaps[i, j] <= self._gap:
                walls.append(np.array([[corners[i], other[j]]]))
        self._corners = np.vstack([self._corners, corners])
        self._walls = np.vstack([self._walls, *walls])

    def distances(self, points: Points) -> Floats:
        """Return how far points, (N,), map frame, are from the nearest box, (N,) m."""
        begins, along = self._walls[:, 0], np.diff(self._walls)[:, 0]
        to = points[:, None] - begins
        share = (to * along.conj()).real / np.maximum(np.abs(along) ** 2, 1e-12)
        off = np.abs(to - np.clip(share, 0.0, 1.0) * along)
        distances: Floats = off.min(axis=1, initial=math.inf)
        return distances

    def samples(self, pose: Pose2) -> Points:
        """Return points of all boxes, (N,), in the frame of a robot at a pose."""
        longest = np.abs(np.diff(self._walls)).max(initial=0.0)
        shares = np.linspace(0.0, 1.0, math.ceil(longest / _SAMPLE) + 1)
        points = self._walls[:, 0, None] + np.diff(self._walls) * shares
        offsets = points.ravel() - complex(pose.x, pose.y)
        seen: Points = offsets * np.exp(-1j * pose.yaw)
        return seen

    def hide(self, observation: Observation) -> Observation:
        """Return a scan whose beams end at the boxes, without things behind them."""
        if not len(self):
            return observation
        pose, farther = observation.pose, observation.farther
        lengths = self._lengths(pose, observation.bearings)
        is_before = farther[:, 1] < self._lengths(pose, farther[:, 0])
        ranges = np.minimum(observation.ranges, lengths)
        return replace(observation, ranges=ranges, farther=farther[is_before])

    def _lengths(self, pose: Pose2, bearings: Floats) -> Floats:
        """Return how far beams get until they meet a box, (N,) m; ``inf`` if none."""
        # turned so that each beam leads along x
        beams = np.exp(-1j * (bearings + pose.yaw))
        ends = (self._walls - complex(pose.x, pose.y)) * beams[:, None, None]
        begin, end = ends[..., 0], ends[..., 1]
        crosses = (begin.imag <= 0) != (end.imag <= 0)
        share = begin.imag / np.where(crosses, begin.imag - end.imag, 1.0)
        ahead = begin.real + share * (end.real - begin.real)
        met = np.where(crosses & (ahead > 0), ahead, math.inf)
        lengths: Floats = met.min(axis=1, initial=math.inf)
        return lengths


class TransientObstacles:
    """Keeps what has vanished from one scan to the next."""

    def __init__(self) -> None:
        self._last: Observation | None = None
        self._kept: deque[tuple[float, Points]] = deque()  # since when, and the box

    def add_to(self, observation: Observation) -> Observation:
        """Return a scan whose beams end at what has vanished; to be called at each.

        Args:
            observation: The newest scan, as it came.
        """
        last, self._last = self._last, observation
        while self._kept and observation.time - self._kept[0][0] >= KEPT_FOR:
            self._kept.popleft()
        if last is not None:
            self._kept += (
                (observation.time, box) for box in _vanished(last, observation)
            )
        places = TouchedPlaces(0.0)
        for _, box in self._kept:
            places.add(box)
        return places.hide(observation)


def _vanished(last: Observation, now: Observation) -> list[Points]:
    """Return boxes, (4,) corners each, map frame, of what a scan no longer shows."""
    near = last.offsets(last.ranges < REACH)
    points = complex(last.pose.x, last.pose.y) + near
    boxes: list[Points] = []
    centres: list[complex] = []
    square = np.array([-1 - 1j, 1 - 1j, 1 + 1j, -1 + 1j]) * _HALF
    for point in points[now.looks_through(points)].tolist():
        if all(abs(point - centre) > _SAME_PLACE for centre in centres):
            centres.append(point)
            # its front is where the beam ended
            turn = np.exp(1j * np.angle(point - complex(now.pose.x, now.pose.y)))
            boxes.append(point + turn * (square + _HALF))
    return boxes


class TouchMemory:
    """Remembers what the footprint touches, and leads back from it.

    Attributes:
        places: Where it has touched something.
    """

    def __init__(self, length: float, width: float, safety_distance: float) -> None:
        """Create it.

        Args:
            length: Of the footprint, m.
            width: Likewise.
            safety_distance: How far back it leads, m from the robot's centre.
        """
        self.places = TouchedPlaces(math.hypot(length, width))
        self._safety_distance = safety_distance
        self._half = np.array([length, width]) / 2
        self._outline, self._normals = _footprint_outline(length, width)
        # how it came: the durations of its motions, s, and their reverse
        self._way_back: deque[tuple[float, Twist]] = deque(maxlen=_MOTIONS)
        self._last: Observation | None = None
        self._motion = STOP  # the last one that was commanded
        self._ahead = 1.0  # or -1: whether the robot last went forward, or backward
        self._moved_at = -math.inf  # s
        # where it last was elsewhere, or had to wait, and when, s
        self._place: Pose2 | None = None
        self._moved_on_at = math.inf
        self._gone_back: float | None = None  # m since it touched something
        self._reverses = False  # whether its motion leads back the way it came

    def notice(self, observation: Observation, twist: Twist) -> bool:
        """Note a scan as it came; return whether something was touched, and is kept.

        Args:
            observation: The newest scan.
            twist: The motion that was commanded since the scan before.
        """
        last, self._last = self._last, observation
        if twist != STOP:
            self._motion, self._moved_at = twist, observation.time
            if twist.speed:
                self._ahead = math.copysign(1.0, twist.speed)
        reverses, self._reverses = self._reverses, False
        if last is not None and not reverses:
            self._add_motion(last, observation)
        was_touched = last is not None and last.touched
        stood = observation.time - self._moved_at > STOOD
        is_touched = observation.touched and not was_touched and not stood
        is_held = observation.time - self._moved_on_at > HELD
        if not is_touched and not is_held:
            return False
        self._moved_on_at = observation.time
        self.places.add(self._touched_box(observation.pose))
        # Who touches something on the way back takes another way out, and so does who
        # got nowhere, whose way back leads nowhere.
        self._gone_back = math.inf if reverses or is_held else 0.0
        return True

    def _add_motion(self, last: Observation, now: Observation) -> None:
        """Add the motion between two scans, by their poses, to the way back."""
        elapsed, pose = now.time - last.time, last.pose
        if elapsed <= 0:
            return
        way = complex(now.pose.x - pose.x, now.pose.y - pose.y)
        speed = (way * np.exp(-1j * pose.yaw)).real / elapsed
        turn = wrap_angle(now.pose.yaw - pose.yaw) / elapsed
        back = Twist(-float(speed), -turn)
        if not _stands(back):
            self._way_back.append((elapsed, back))

    def note_decision(self, observation: Observation, twist: Twist | None) -> None:
        """Note what was decided by a scan: a motion, or None to wait."""
        pose = observation.pose
        place = self._place
        if twist is None or place is None or pose.is_apart(place, *MOVED):
            self._place, self._moved_on_at = pose, observation.time

    def retreat(self, observation: Observation) -> Twist | None:
        """Return the motion back from what was touched; None away from it.

        Args:
            observation: The newest scan, after ``notice``, without what boxes hide.
        """
        if self._gone_back is None:
            return None
        place = complex(observation.pose.x, observation.pose.y)
        (near,) = self.places.distances(np.array([place]))
        near = observation.ranges.min(initial=near)
        is_away = near >= self._safety_distance and not observation.touched
        has_way = not is_away and self._gone_back <= LONGEST_WAY_BACK
        if has_way and self._way_back:
            elapsed, back = self._way_back.pop()
            self._gone_back += abs(back.speed) * elapsed
            self._reverses = True
            return back
        way_out = None if is_away else self._way_out(observation)
        # Who is on the way out does not go back on that, unless it touches something.
        self._gone_back = None if way_out is None else math.inf
        return way_out

    def keep_off(self, observation: Observation, twist: Twist) -> Twist:
        """Return a motion, or one that leads away if it would touch a box again.

        Args:
            observation: The newest scan, after ``retreat``.
            twist: The motion that was decided on.
        """
        if _stands(twist):
            return twist
        boxes = self.places.samples(observation.pose)
        # The footprint may come as near to what it sees as planned paths lead.
        things = ((boxes, _CLOSE), (_ends(observation), 0.0))
        if all(self._keeps_off(points, twist, least) for points, least in things):
            return twist
        self._gone_back = 0.0
        return self.retreat(observation) or twist

    def _keeps_off(self, points: Points, twist: Twist, least: float) -> bool:
        """Return whether a motion leads the robot no nearer to points than that, m."""
        now = self._distance_at(points, STOP, 0.0)
        # What seems to be inside stands close by: corners that turn may graze it.
        if now < 0 and abs(twist.speed) < LEAST_SPEED:
            return False
        soon = min(self._distance_at(points, twist, time) for time in _SOON)
        return soon >= min(least, now)

    def _way_out(self, observation: Observation) -> Twist | None:
        """Return the motion that leads away from boxes, past all else; None if none."""
        boxes = self.places.samples(observation.pose)
        seen = _ends(observation)
        points = np.concatenate([boxes, seen])
        boxes = boxes if len(boxes) else seen
        least = min(_CLOSE, self._distance_at(points, STOP, 0.0))
        best, most = None, np.abs(boxes).min() + _GAIN
        for twist in (Twist(v, w) for v in _SPEEDS for w in _TURNS):
            end = _motion_after(twist, _AHEAD[-1])[0]
            away = np.abs(boxes - end).min()
            if away > most and all(
                self._distance_at(points, twist, time) >= least for time in _AHEAD
            ):
                best, most = twist, away
        return best

    def _distance_at(self, points: Points, twist: Twist, time: float) -> float:
        """Return how far the footprint will be from points, m; < 0 inside.

        Args:
            points: (N,) m.
            twist: The motion.
            time: s from now.
        """
        place, turned = _motion_after(twist, time)
        there = (points - place) * np.exp(-1j * turned)
        x, y = np.abs(there.real) - self._half[0], np.abs(there.imag) - self._half[1]
        outside = np.hypot(np.maximum(x, 0.0), np.maximum(y, 0.0))
        distances = outside + np.minimum(np.maximum(x, y), 0.0)
        return float(distances.min(initial=math.inf))

    def _touched_box(self, pose: Pose2) -> Points:
        """Return the corners of a box at the side that led, map frame."""
        points, normals = self._outline, self._normals
        velocity = self._motion.speed + 1j * self._motion.turn * points
        outward = (velocity * normals.conj()).real
        led = outward >= _LEADING * outward.max()
        to_map = np.exp(1j * pose.yaw)
        place = complex(pose.x, pose.y)
        away = np.where(led, self.places.distances(place + to_map * points), math.inf)
        if away.min() < _SAME:
            # most likely more of the same thing
            nearest = int(away.argmin())
            led &= np.abs(points - points[nearest]) <= _PART
            normal = normals[nearest]
        else:
            is_heading = led & (normals == self._ahead)
            normal = self._ahead if is_heading.any() else normals[outward.argmax()]
        side = points[led & (normals == normal)] * np.conj(normal)
        depth, low, high = side.real[0], side.imag.min(), side.imag.max()
        more = max(0.0, LEAST_WIDTH - (high - low)) / 2
        low, high = low - more, high + more
        box = np.array([low, high, high, low]) * 1j
        box += depth + np.array([0.0, 0.0, DEPTH, DEPTH])
        corners: Points = place + to_map * normal * box
        return corners


def _ends(observation: Observation) -> Points:
    """Return the ends of beams, (N,) m, robot's frame."""
    near = observation.ranges < HORIZON
    ends: Points = observation.ranges[near] * np.exp(1j * observation.bearings[near])
    return ends


def _motion_after(twist: Twist, time: float) -> tuple[complex, float]:
    """Return where a motion leads, m, robot's frame, and by how much it turns, rad."""
    turned = twist.turn * time
    # of the arc its chord, by its middle; exact enough for a second
    return twist.speed * time * complex(
        math.cos(turned / 2), math.sin(turned / 2)
    ), turned


def _stands(twist: Twist) -> bool:
    return abs(twist.speed) < LEAST_SPEED and abs(twist.turn) < LEAST_TURN


def _footprint_outline(length: float, width: float) -> tuple[Points, Points]:
    """Return points on the outline and the directions outward there, robot's frame.

    Returns:
        (N,) each; corners are points of both sides.
    """
    points, normals = [], []
    across = np.linspace(-1.0, 1.0, _POINTS)
    for normal in (1, 1j, -1, -1j):
        half, other = (length, width) if normal.real else (width, length)
        points.append(normal * (half + 1j * across * other) / 2)
        normals.append(np.full(_POINTS, normal, np.complex128))
    return np.concatenate(points), np.concatenate(normals)
