"""Moving objects: the robot avoids an object that crosses its path, or waits for it.

Theory of operation
===================
Each scan is compared with a scan from a moment before. A point where an earlier beam
passed through belongs to an object that has moved there. A point that was hidden behind
a nearer obstacle may have been there before, and is ignored.

The first and the current position of the object give its velocity after half a second,
so objects are tracked from a few metres away. The robot stops if it would come too
close to the object within the next seconds, and if stopping increases the distance.

Stopping does not help against an object that approaches head-on without stopping. A
robot that plans paths does not wait for such an object. Its paths avoid the current
position of the object and its predicted positions for three seconds, and pass the
object on the side where the robot already is, or else on the right. When several
objects move, their tracks are ambiguous, and every robot waits.

A waiting robot follows no boundary, so a passing object does not become an obstacle. An
object that has stopped is an obstacle like any other.

An object that does not give way may drive into the robot. Then the robot neither turns
nor drives on, since both would press it against the object: it backs off until it has
room to turn. The robot backs off only near positions where an object has moved, since
among standing obstacles there may be no room. In a mirror next to the robot, the image
of the robot moves with it. So only motion counts that was seen while the robot stood.
"""

import math
from collections import deque
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.control import STOP, Twist
from radarsim.autonomy.navigation.observation import BEHIND, Observation
from radarsim.geometry import Floats

INTERVAL: Final = 2.0  # s between the compared scans
LEAST_BEAMS: Final = 3  # beams that have to end on a moving object
SPEED: Final = 0.3  # m/s; assumed speed of the robot
HORIZON: Final = 4.0  # s for which motion is predicted
MORE: Final = 2.5  # m beyond the reach of the bumpers in which motion is detected
LEAST_TRACK: Final = 0.5  # s of tracking before the velocity is known
PAUSE: Final = 1.0  # s without motion before the robot drives on
CONFIRMED_WITHIN: Final = 1.0  # s until a second scan has to confirm the motion
PATIENCE: Final = 15.0  # s of waiting before the robot drives on anyway
IMPATIENCE: Final = 5.0  # s after waiting, before the robot may wait again
SEEN_COMING: Final = 2.0  # m beyond ``MORE`` in which approaching objects are seen
MET_WITHIN: Final = np.arange(0.0, 8.1, 0.25)  # s; predicted times of a meeting
KEPT_OUT_OF: Final = np.arange(0.0, 3.1, 0.25)  # s; predicted times that paths avoid
HEAD_ON: Final = math.cos(math.radians(45))  # least cosine of a head-on approach
BESIDE_IT: Final = 0.6  # m to one side of the object that paths keep clear as well
STRAIGHT_AT: Final = 0.1  # m off the robot's centre that counts as head-on
ASIDE: Final = 0.3  # m beyond the safety distance, to pass an object
REMEMBERED: Final = 0.5  # s for which an unseen object's motion is extrapolated
ONE_THING: Final = 1.5  # m; a wider group of points is more than one object
BACK_SPEED: Final = 0.3  # m/s; speed away from an object that hit the robot
RECENT: Final = 30.0  # s; older motions do not make the robot back off
MOVED_NEAR: Final = 0.5  # m between an earlier motion and the obstacle to back off from
# largest change of pose between two scans of a standing robot, m and rad
STOOD: Final = (0.05, 0.05)


class Waiting:
    """Decides whether the robot has to stop because an object moves into its path."""

    def __init__(self, bumpers: Bumpers, clearance: float) -> None:
        """Create the detector.

        Args:
            bumpers: Bumpers of the robot.
            clearance: Free radius around the robot's centre that it needs to turn, m.
        """
        self._bumpers = bumpers
        self._clearance = clearance
        # recent scans: the newest is compared with the oldest
        # once the interval between them is long enough
        self._earlier: deque[Observation] = deque()
        # times, s, and positions, m, map frame, of moving objects that were seen
        self._seen: deque[tuple[float, complex]] = deque()
        self._ahead = 1.0  # 1 or -1: whether the robot drives forward or backward
        self._moved = -math.inf  # s; when an object last moved into the path
        self._crossed = -math.inf  # s; when a scan last showed such an object
        # times, s, and positions, m, map frame, of motions seen while the robot stood
        self._motions: deque[tuple[float, complex]] = deque()
        self._since = math.inf  # s; time at which the robot began to wait
        self._passing_distance = bumpers.safety_distance + ASIDE
        # last scan with a single moving object: its time, s, the ends of beams on the
        # object, m, map frame, and the object's velocity, m/s
        self._thing: tuple[float, NDArray[np.complex128], complex] | None = None
        self._track: deque[tuple[float, complex]] = deque()  # times and positions
        self._closed_side = -1j  # side of the object that paths avoid
        self._meets = False  # whether the object approaches the robot
        self._impatient_until = -math.inf  # s

    def has_to_wait(
        self,
        observation: Observation,
        twist: Twist,
        still: NDArray[np.bool_] | None = None,
    ) -> bool:
        """Return whether the robot has to wait for the next scan; call it at each scan.

        Args:
            observation: The newest scan.
            twist: The motion since the previous scan, which sets the robot's direction.
            still: Beams that end on known standing obstacles, (N,); None for none.
        """
        now = observation.time
        # A robot that stands will drive on in its
        # last direction, so that direction is kept.
        if twist.speed:
            self._ahead = math.copysign(1.0, twist.speed)
        if self._detect_crossing(observation, still):
            if now - self._crossed <= CONFIRMED_WITHIN:  # a single scan may be in error
                self._moved = now
            self._crossed = now
        if now - self._moved >= PAUSE or now < self._impatient_until:
            self._since = math.inf
            return False
        self._since = min(self._since, now)
        if now - self._since < PATIENCE:
            return True
        # After a long wait, the robot does not wait for a
        # while, since the next scan would stop it again.
        self._impatient_until = now + IMPATIENCE
        return False

    def moving_beams(self, observation: Observation, reach: float) -> NDArray[np.bool_]:
        """Return which beams, as (N,) booleans, end on an object that has moved.

        Args:
            observation: The newest scan; the times of scans increase.
            reach: Longer beams are ignored, m.
        """
        earlier, due = self._earlier, observation.time - (INTERVAL - 1e-6)
        earlier.append(observation)
        while len(earlier) > 1 and earlier[1].time <= due:
            earlier.popleft()
        beams = observation.ranges < reach
        if earlier[0].time > due:
            return np.zeros_like(beams)
        ends = observation.offsets(beams)
        ends += complex(observation.pose.x, observation.pose.y)
        beams[beams] = earlier[0].looks_through(ends)
        return beams

    def meeting(self, observation: Observation) -> Floats:
        """Return where an approaching object is and where it will be, (M, 2) m.

        Positions are in the map frame; M is 0 without an approaching object.

        Args:
            observation: The newest scan, after ``has_to_wait``.
        """
        now, pose = observation.time, observation.pose
        if self._thing is None or now - self._thing[0] > REMEMBERED:
            self._thing, self._meets = None, False
            return np.zeros((0, 2))
        seen, ends, velocity = self._thing
        to_robot = complex(pose.x, pose.y) - (ends + velocity * (now - seen))
        off = np.abs(to_robot[:, None] - velocity * MET_WITHIN).min()
        heading = complex(math.cos(pose.yaw), math.sin(pose.yaw))
        against = (velocity * heading.conjugate()).real < -HEAD_ON * abs(velocity)
        # An object that was approaching still counts as approaching while the robot
        # turns aside.
        met_before = self._meets
        least = self._passing_distance * (1.5 if met_before else 1.0)
        self._meets = bool(off < least and (met_before or against))
        if not self._meets:
            return np.zeros((0, 2))
        along = velocity / abs(velocity)
        # The robot chooses only once on which side it passes the object, since the
        # shorter side may change from plan to plan. If the object comes head-on, the
        # robot passes on the right.
        if not met_before:
            is_left_of_it = (complex(to_robot.mean()) / along).imag > -STRAIGHT_AT
            self._closed_side = -1j if is_left_of_it else 1j
        places = ends[:, None] + velocity * (now - seen + KEPT_OUT_OF)
        aside = places.ravel() + BESIDE_IT * self._closed_side * along
        both = np.concatenate([places.ravel(), aside])
        return np.column_stack([both.real, both.imag])

    def back_off(self, observation: Observation) -> Twist | None:
        """Return a motion away from a moving object next to the robot; None if none.

        Args:
            observation: The newest scan, after ``has_to_wait``.
        """
        ranges, bearings = observation.ranges, observation.bearings
        if ranges.min(initial=math.inf) >= self._clearance:
            return None
        if not self._has_moved(observation):
            return None
        # The robot drives away from the nearest point without turning, since a turn
        # would swing its corners into the object.
        forward = -math.copysign(1.0, math.cos(bearings[ranges.argmin()]))
        ahead = forward * np.cos(bearings) > 0.5
        if (ranges[ahead] < self._clearance + BEHIND).any():
            return STOP
        return Twist(forward * BACK_SPEED, 0.0)

    def _has_moved(self, observation: Observation) -> bool:
        """Return whether an object has just moved where the shortest beam ends."""
        while self._motions and observation.time - self._motions[0][0] >= RECENT:
            self._motions.popleft()
        (away,) = observation.offsets(observation.ranges.argmin(axis=0, keepdims=True))
        point = complex(observation.pose.x, observation.pose.y) + complex(away)
        return any(abs(place - point) < MOVED_NEAR for _, place in self._motions)

    def _follow(self, observation: Observation, beams: NDArray[np.bool_]) -> None:
        """Store position and velocity of the moving object, if there is only one."""
        if np.count_nonzero(beams) < LEAST_BEAMS:
            return
        pose, now = observation.pose, observation.time
        ends = observation.offsets(beams) + complex(pose.x, pose.y)
        centre = complex(ends.mean())
        velocity = _add_to_track(self._track, now, centre)
        is_one = np.abs(ends - centre).max() <= ONE_THING / 2
        if is_one and velocity:
            self._thing = now, ends, velocity

    def _detect_crossing(
        self, observation: Observation, still: NDArray[np.bool_] | None
    ) -> bool:
        """Return whether a moving object will come too close if the robot drives on."""
        reach = self._bumpers.pressed_below + MORE
        beams = self.moving_beams(observation, reach + SEEN_COMING)
        if still is not None:
            beams &= ~still
        self._follow(observation, beams)
        beams &= observation.ranges < reach
        if np.count_nonzero(beams) < LEAST_BEAMS:
            return False

        pose, now = observation.pose, observation.time
        ends = observation.offsets(beams)
        centre = complex(ends.mean())
        place = centre + complex(pose.x, pose.y)
        velocity = _add_to_track(self._seen, now, place)
        if not pose.is_apart(self._earlier[0].pose, *STOOD):
            self._motions.append((now, place))
        going = self._ahead * SPEED * complex(math.cos(pose.yaw), math.sin(pose.yaw))
        times = np.arange(0.0, HORIZON, 0.25)
        # Both the robot and the object move, so the least
        # distance is found in steps of a quarter second. Stopping
        # does not help a robot that stands in the object's path.
        driving = np.abs(ends[:, None] + (velocity - going) * times).min()
        standing = np.abs(ends[:, None] + velocity * times).min()
        return bool(driving < min(self._bumpers.pressed_below, standing))


def _add_to_track(
    track: deque[tuple[float, complex]], now: float, place: complex
) -> complex:
    """Add the position of an object to its track; return its velocity, m/s, or 0."""
    track.append((now, place))
    while now - track[0][0] > INTERVAL:
        track.popleft()
    begin, first = track[0]
    # A track of only one or two scans would give a random velocity because of noise.
    return (place - first) / (now - begin) if now - begin >= LEAST_TRACK else 0j
