"""Obstacles that the robot has touched, or that only earlier scans show.

Theory of operation
===================
A mirror reflects a beam, so the beam ends at a point that appears behind the mirror.
Points that appear in front of a mirror are real, and points that appear behind it may
not be. A robot may drive into an obstacle that it cannot see. Its touch sensors report
the contact, but not the position of the contact. The contact is on the leading side of
the footprint, which moved outward.

A box as wide as the leading side is stored there in the map frame. From then on beams
end at the box, and returns from behind it are dropped. If the gap between two boxes is
too narrow for the robot, beams end there as well. So every algorithm that steers by
scans treats touched obstacles like seen ones.

The robot backs up along the path it came, which was free, until everything seen or
touched is as far away as the safety distance. A robot that stood stores no box: another
robot has driven into it, and will drive away. Along a mirror the path back also leads
along the mirror. So at the end of that path, the robot chooses the motion that moves
its centre away and its footprint past all seen and touched obstacles. The robot also
chooses such a motion in place of a motion that would press its footprint against an
obstacle, such as a turn next to the obstacle. So it touches no obstacle twice. If it
touches an obstacle on the way out, it backs up again.

A robot that faces a mirror sees its own image approach. It may stop in front of the
image forever, and in a gap between mirrors it may turn left and right again and again.
So a robot that makes no progress treats the obstacle ahead as touched.

The end of a plate is thin, so beams may miss it: one scan shows the end, and the next
scan does not. If the plate is a mirror, the next scan shows a distant point instead. A
robot that steers by single scans would turn away from the end in one scan and towards
it in the next scan, until the robot touches the end.

So a point that one scan shows near the robot, and that the next scan looks through, is
stored for a few seconds: beams end there as if they had hit it. A moving object is not
stored, since it is seen next to its old position, or slightly farther away.
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

DEPTH: Final = 0.1  # m; depth of a box, so that it is visible from its ends
LEAST_WIDTH: Final = 0.2  # m; width of a box, so that bumpers detect it
STOOD: Final = 0.5  # s without a motion command, after which the robot stands
HELD: Final = 8.0  # s without progress or waiting, after which an obstacle is assumed
LONGEST_WAY_BACK: Final = 1.0  # m; greatest length of the path back
LEAST_SPEED: Final = 0.02  # m/s; slower counts as standing
LEAST_TURN: Final = 0.05  # rad/s; slower counts as standing
_MOTIONS: Final = 200  # motions stored for driving back
_POINTS: Final = 5  # points on each side of the footprint
_LEADING: Final = 0.5  # share of the top outward speed; faster points are leading
_CLOSE: Final = 0.02  # m from the footprint to a box that it may touch
_SOON: Final = (0.15, 0.3)  # s; times at which a decided motion is checked
_AHEAD: Final = (0.25, 0.5, 0.75, 1.0)  # s; times at which a motion away is checked
_GAIN: Final = 0.01  # m; least gain of distance by such a motion
_SPEEDS: Final = (0.2, -0.2)  # m/s of motions away from obstacles
_TURNS: Final = (0.0, 0.1, -0.1, 0.2, -0.2, 0.4, -0.4, 0.8, -0.8)  # rad/s
_SAMPLE: Final = 0.05  # m between two points of a box
_SAME: Final = 0.6  # m from a box to a second contact with the same obstacle
_PART: Final = 0.15  # m around the contact point that the new box covers
KEPT_FOR: Final = 3.0  # s for which a vanished point is stored
REACH: Final = 0.65  # m; farther poles may fit between two beams
_SAME_PLACE: Final = 0.1  # m between vanished points that count as one
_HALF: Final = 0.05  # m; half the side of the box of a vanished point

Points: TypeAlias = NDArray[np.complex128]  # x + iy, m


class TouchedPlaces:
    """Boxes where the robot touched obstacles; can cut off the beams of scans there."""

    def __init__(self, gap: float) -> None:
        """Create an empty collection of boxes.

        Args:
            gap: Widest gap between two boxes that the robot cannot pass, m.
        """
        self._gap = gap
        self._corners: Points = np.zeros((0, 4), np.complex128)  # map frame
        self._walls: Points = np.zeros((0, 2), np.complex128)  # both ends of each wall

    def __len__(self) -> int:
        return len(self._corners)

    def add(self, corners: Points) -> None:
        """Add a box, given by its four corners in order, (4,), map frame."""
        walls = [np.column_stack([corners, np.roll(corners, -1)])]
        for other in self._corners:
            gaps = np.abs(corners[:, None] - other)
            i, j = np.unravel_index(gaps.argmin(), gaps.shape)
            if gaps[i, j] <= self._gap:
                walls.append(np.array([[corners[i], other[j]]]))
        self._corners = np.vstack([self._corners, corners])
        self._walls = np.vstack([self._walls, *walls])

    def distances(self, points: Points) -> Floats:
        """Return the distance, (N,) m, of each point, map frame, to the nearest box."""
        begins, along = self._walls[:, 0], np.diff(self._walls)[:, 0]
        to = points[:, None] - begins
        share = (to * along.conj()).real / np.maximum(np.abs(along) ** 2, 1e-12)
        off = np.abs(to - np.clip(share, 0.0, 1.0) * along)
        distances: Floats = off.min(axis=1, initial=math.inf)
        return distances

    def samples(self, pose: Pose2) -> Points:
        """Return points on the sides of all boxes, (N,), in the frame of a pose."""
        longest = np.abs(np.diff(self._walls)).max(initial=0.0)
        shares = np.linspace(0.0, 1.0, math.ceil(longest / _SAMPLE) + 1)
        points = self._walls[:, 0, None] + np.diff(self._walls) * shares
        offsets = points.ravel() - complex(pose.x, pose.y)
        seen: Points = offsets * np.exp(-1j * pose.yaw)
        return seen

    def hide(self, observation: Observation) -> Observation:
        """Return the scan with its beams cut off at the boxes."""
        if not len(self):
            return observation
        pose, farther = observation.pose, observation.farther
        lengths = self._lengths(pose, observation.bearings)
        is_before = farther[:, 1] < self._lengths(pose, farther[:, 0])
        ranges = np.minimum(observation.ranges, lengths)
        return replace(observation, ranges=ranges, farther=farther[is_before])

    def _lengths(self, pose: Pose2, bearings: Floats) -> Floats:
        """Return how far each beam gets before it meets a box, (N,) m; else ``inf``."""
        # For each beam, the walls are rotated so that the beam lies along the x axis.
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
    """Keeps obstacles in the scans for some seconds after they have vanished."""

    def __init__(self) -> None:
        self._last: Observation | None = None
        self._kept: deque[tuple[float, Points]] = deque()  # time stored, s, and box

    def add_to(self, observation: Observation) -> Observation:
        """Return the scan with vanished obstacles added; call this for each scan.

        Args:
            observation: The newest scan, unchanged.
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
    """Return boxes, (4,) corners each, map frame, where obstacles have vanished."""
    near = last.offsets(last.ranges < REACH)
    points = complex(last.pose.x, last.pose.y) + near
    boxes: list[Points] = []
    centres: list[complex] = []
    square = np.array([-1 - 1j, 1 - 1j, 1 + 1j, -1 + 1j]) * _HALF
    for point in points[now.looks_through(points)].tolist():
        if all(abs(point - centre) > _SAME_PLACE for centre in centres):
            centres.append(point)
            # The near side of the box is at the point where the beam ended.
            turn = np.exp(1j * np.angle(point - complex(now.pose.x, now.pose.y)))
            boxes.append(point + turn * (square + _HALF))
    return boxes


class TouchMemory:
    """Remembers where the footprint touched obstacles, and steers the robot away.

    Attributes:
        places: Boxes at the contacts.
    """

    def __init__(self, length: float, width: float, safety_distance: float) -> None:
        """Create an empty memory of contacts.

        Args:
            length: Length of the footprint, m.
            width: Width of the footprint, m.
            safety_distance: Distance from the robot's centre to back up to, m.
        """
        self.places = TouchedPlaces(math.hypot(length, width))
        self._safety_distance = safety_distance
        self._half = np.array([length, width]) / 2
        self._outline, self._normals = _footprint_outline(length, width)
        # duration, s, and reverse of each of the robot's last motions
        self._way_back: deque[tuple[float, Twist]] = deque(maxlen=_MOTIONS)
        self._last: Observation | None = None
        self._motion = STOP  # the last motion command other than STOP
        self._ahead = 1.0  # 1 or -1: whether the robot last drove forward or backward
        self._moved_at = -math.inf  # time of the last motion command, s
        # pose and time, s, when the robot last made progress or had to wait
        self._place: Pose2 | None = None
        self._moved_on_at = math.inf
        self._gone_back: float | None = None  # m driven back since the contact
        self._reverses = False  # whether the current motion leads back along the path

    def notice(self, observation: Observation, twist: Twist) -> bool:
        """Process a scan; if the robot touches an obstacle, store it and return True.

        Args:
            observation: The newest scan, unchanged.
            twist: The motion command since the previous scan.
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
        # Driving back does not help if the robot was driving back when it touched the
        # obstacle, or if it made no progress. It then searches for another way out.
        self._gone_back = math.inf if reverses or is_held else 0.0
        return True

    def _add_motion(self, last: Observation, now: Observation) -> None:
        """Reverse the robot's motion between two scans, and add it to the way back."""
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
        """Store the motion decided on for a scan, or None if the robot waits."""
        pose = observation.pose
        place = self._place
        if twist is None or place is None or pose.is_apart(place, *MOVED):
            self._place, self._moved_on_at = pose, observation.time

    def retreat(self, observation: Observation) -> Twist | None:
        """Return a motion away from a touched obstacle; None if the robot is clear.

        Args:
            observation: The newest scan after ``notice``, without returns behind boxes.
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
        # After the robot has found another way out, it does not drive back along its
        # path until the next contact.
        self._gone_back = None if way_out is None else math.inf
        return way_out

    def keep_off(self, observation: Observation, twist: Twist) -> Twist:
        """Return the given motion, or another one if it would touch an obstacle.

        Args:
            observation: The newest scan, after ``retreat``.
            twist: The motion that the controller decided on.
        """
        if _stands(twist):
            return twist
        boxes = self.places.samples(observation.pose)
        # The robot may come close to seen points, since planned
        # paths do so, but not to boxes at touched obstacles.
        things = ((boxes, _CLOSE), (_ends(observation), 0.0))
        if all(self._keeps_off(points, twist, least) for points, least in things):
            return twist
        self._gone_back = 0.0
        return self.retreat(observation) or twist

    def _keeps_off(self, points: Points, twist: Twist, least: float) -> bool:
        """Return whether the footprint keeps a distance, m, from points in a motion."""
        now = self._distance_at(points, STOP, 0.0)
        # Points that seem to be inside the footprint are close to its outline, so a
        # corner of the robot may graze them in a turn.
        if now < 0 and abs(twist.speed) < LEAST_SPEED:
            return False
        soon = min(self._distance_at(points, twist, time) for time in _SOON)
        return soon >= min(least, now)

    def _way_out(self, observation: Observation) -> Twist | None:
        """Return a motion away from the boxes that hits no point; None if none."""
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
        """Return how far, m, points are from the footprint after a motion; < 0 inside.

        Args:
            points: (N,) m, robot's frame.
            twist: The motion of the footprint.
            time: Duration of the motion, s.
        """
        place, turned = _motion_after(twist, time)
        there = (points - place) * np.exp(-1j * turned)
        x, y = np.abs(there.real) - self._half[0], np.abs(there.imag) - self._half[1]
        outside = np.hypot(np.maximum(x, 0.0), np.maximum(y, 0.0))
        distances = outside + np.minimum(np.maximum(x, y), 0.0)
        return float(distances.min(initial=math.inf))

    def _touched_box(self, pose: Pose2) -> Points:
        """Return corners, map frame, of a box where the footprint hit an obstacle."""
        points, normals = self._outline, self._normals
        velocity = self._motion.speed + 1j * self._motion.turn * points
        outward = (velocity * normals.conj()).real
        led = outward >= _LEADING * outward.max()
        to_map = np.exp(1j * pose.yaw)
        place = complex(pose.x, pose.y)
        away = np.where(led, self.places.distances(place + to_map * points), math.inf)
        if away.min() < _SAME:
            # Most likely this is another part of an obstacle that was touched before.
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
    """Return the end points of beams, (N,) m, in the robot's frame."""
    near = observation.ranges < HORIZON
    ends: Points = observation.ranges[near] * np.exp(1j * observation.bearings[near])
    return ends


def _motion_after(twist: Twist, time: float) -> tuple[complex, float]:
    """Return how far, m, in the robot's frame, and by how much, rad, a motion leads."""
    turned = twist.turn * time
    # The arc is approximated by a line in its mean
    # direction, which is accurate enough for one second.
    return twist.speed * time * complex(
        math.cos(turned / 2), math.sin(turned / 2)
    ), turned


def _stands(twist: Twist) -> bool:
    return abs(twist.speed) < LEAST_SPEED and abs(twist.turn) < LEAST_TURN


def _footprint_outline(length: float, width: float) -> tuple[Points, Points]:
    """Return points on the footprint's outline and outward normals, robot's frame.

    Returns:
        (N,) each; every corner is a point of both of its sides.
    """
    points, normals = [], []
    across = np.linspace(-1.0, 1.0, _POINTS)
    for normal in (1, 1j, -1, -1j):
        half, other = (length, width) if normal.real else (width, length)
        points.append(normal * (half + 1j * across * other) / 2)
        normals.append(np.full(_POINTS, normal, np.complex128))
    return np.concatenate(points), np.concatenate(normals)
