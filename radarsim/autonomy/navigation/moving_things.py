"""Things that move: who sees something come into its way goes round it, or waits.

Theory of operation
===================
A scan is compared with one of a moment before. A thing that is now seen where a beam
went through then has come there: it moves. A thing that was hidden then, behind
something nearer, may as well have stood there, and does not count.

From where it is seen at first and now follows its velocity, which is known after half a
second: so things are looked at some metres away, before they are near. The robot stands
if the two would come too near to each other within the next seconds, and less so if it
stands.

To stand does not help where something comes the other way and does not stop. A robot
that plans paths does not wait for that. Its paths keep out of where the thing is and
will be within three seconds, if it goes on as it does, and pass it on the side on which
the robot is already, or else on the right. Where several things move, it is not known
which of them goes where, and all robots wait.

A robot that waits for something follows nothing, so what passes becomes no obstacle.
What has come to a stand is an obstacle like others.

What does not give way may drive into the robot. Then the robot neither turns nor goes
on, since both would press against it: it backs off until it has room to turn. It does
so only from things where something has moved: among things that stand it would have no
room. In a mirror at its side its own image moves as it does. So here only motion counts
that it has seen while it stood.
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

INTERVAL: Final = 2.0  # s between the scans that are compared
LEAST_BEAMS: Final = 3  # that end on something that moves
SPEED: Final = 0.3  # m/s at which the robot would go on
HORIZON: Final = 4.0  # s ahead that are looked at
MORE: Final = 2.5  # m beyond the reach of the bumpers within which motion is seen
LEAST_TRACK: Final = 0.5  # s for which it is seen before its velocity is known
PAUSE: Final = 1.0  # s without motion after which it goes on
CONFIRMED_WITHIN: Final = 1.0  # s in which a second scan has to show the same
PATIENCE: Final = 15.0  # s of waiting after which it goes on nevertheless
IMPATIENCE: Final = 5.0  # s after that, in which it does not wait
SEEN_COMING: Final = 2.0  # m farther than that, where what meets the robot is seen
MET_WITHIN: Final = np.arange(0.0, 8.1, 0.25)  # s in which something meets the robot
KEPT_OUT_OF: Final = np.arange(0.0, 3.1, 0.25)  # s of its way that paths keep out of
HEAD_ON: Final = math.cos(math.radians(45))  # of its direction, against the robot's
BESIDE_IT: Final = 0.6  # m to one side of it that paths keep out of as well
STRAIGHT_AT: Final = 0.1  # m off the robot, where it comes straight at it
ASIDE: Final = 0.3  # m more than the safety distance, within which it meets
REMEMBERED: Final = 0.5  # s for which a thing that no scan shows is where it would be
ONE_THING: Final = 1.5  # m; what moves farther apart is more than one
BACK_SPEED: Final = 0.3  # m/s away from what has driven into the robot
RECENT: Final = 30.0  # s after motion was seen, in which it backs off
MOVED_NEAR: Final = 0.5  # m from where that was, to what it backs off from
# m and rad between the scans that are compared, if the robot stood
STOOD: Final = (0.05, 0.05)


class Waiting:
    """Decides when to stand because something moves into the robot's way."""

    def __init__(self, bumpers: Bumpers, clearance: float) -> None:
        """Create it.

        Args:
            bumpers: Bumpers of the robot.
            clearance: What the robot needs around its centre to turn, m.
        """
        self._bumpers = bumpers
        self._clearance = clearance
        # the scan that is compared with, once it is old enough, and all since
        self._earlier: deque[Observation] = deque()
        # when and where things moved, s and m, map frame
        self._seen: deque[tuple[float, complex]] = deque()
        self._ahead = 1.0  # or -1: whether the robot went forward, or backward
        self._moved = -math.inf  # s; when something last moved into its way
        self._crossed = -math.inf  # s; when a scan last showed that
        # when and where something moved while the robot stood, s and m, map frame
        self._motions: deque[tuple[float, complex]] = deque()
        self._since = math.inf  # s; since when it waits
        self._passing_distance = bumpers.safety_distance + ASIDE
        # when, ends of beams on one thing that moves, m, map frame, its velocity, m/s
        self._thing: tuple[float, NDArray[np.complex128], complex] | None = None
        self._track: deque[tuple[float, complex]] = deque()  # when and where it was
        self._closed_side = -1j  # of what meets the robot, as it drives: right, or left
        self._meets = False  # whether that meets the robot
        self._impatient_until = -math.inf  # s

    def has_to_wait(
        self,
        observation: Observation,
        twist: Twist,
        still: NDArray[np.bool_] | None = None,
    ) -> bool:
        """Return whether to stand until the next scan; to be called at every scan.

        Args:
            observation: The newest scan.
            twist: The motion since the scan before, which shows where ahead is.
            still: Beams that end on things known to stand, (N,); None for none.
        """
        now = observation.time
        # A robot that stands keeps its direction, as it will go on in that.
        if twist.speed:
            self._ahead = math.copysign(1.0, twist.speed)
        if self._detect_crossing(observation, still):
            if now - self._crossed <= CONFIRMED_WITHIN:  # one scan may be in error
                self._moved = now
            self._crossed = now
        if now - self._moved >= PAUSE or now < self._impatient_until:
            self._since = math.inf
            return False
        self._since = min(self._since, now)
        if now - self._since < PATIENCE:
            return True
        # It goes on for a while, or the next scan would stop it again.
        self._impatient_until = now + IMPATIENCE
        return False

    def moving_beams(self, observation: Observation, reach: float) -> NDArray[np.bool_]:
        """Return which beams end on something that has moved, (N,).

        Args:
            observation: The newest scan; the times of scans increase.
            reach: Longer beams are left out, m.
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
        """Return where what meets the robot is and will be, (M, 2) m, map frame.

        M is 0 if nothing does.

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
        # The robot turns aside, and it is still the same that meets it.
        met_before = self._meets
        least = self._passing_distance * (1.5 if met_before else 1.0)
        self._meets = bool(off < least and (met_before or against))
        if not self._meets:
            return np.zeros((0, 2))
        along = velocity / abs(velocity)
        # Once, or the shorter side may change from plan to plan; if it comes straight
        # at the robot, both keep to the right.
        if not met_before:
            is_left_of_it = (complex(to_robot.mean()) / along).imag > -STRAIGHT_AT
            self._closed_side = -1j if is_left_of_it else 1j
        places = ends[:, None] + velocity * (now - seen + KEPT_OUT_OF)
        aside = places.ravel() + BESIDE_IT * self._closed_side * along
        both = np.concatenate([places.ravel(), aside])
        return np.column_stack([both.real, both.imag])

    def back_off(self, observation: Observation) -> Twist | None:
        """Return the motion away from what has driven into the robot; None if nothing.

        Args:
            observation: The newest scan, after ``has_to_wait``.
        """
        ranges, bearings = observation.ranges, observation.bearings
        if ranges.min(initial=math.inf) >= self._clearance:
            return None
        if not self._has_moved(observation):
            return None
        # Away from the nearest point, without a turn: its corners would swing into it.
        forward = -math.copysign(1.0, math.cos(bearings[ranges.argmin()]))
        ahead = forward * np.cos(bearings) > 0.5
        if (ranges[ahead] < self._clearance + BEHIND).any():
            return STOP
        return Twist(forward * BACK_SPEED, 0.0)

    def _has_moved(self, observation: Observation) -> bool:
        """Return whether something moved lately where the nearest thing is now."""
        while self._motions and observation.time - self._motions[0][0] >= RECENT:
            self._motions.popleft()
        (away,) = observation.offsets(observation.ranges.argmin(axis=0, keepdims=True))
        point = complex(observation.pose.x, observation.pose.y) + complex(away)
        return any(abs(place - point) < MOVED_NEAR for _, place in self._motions)

    def _follow(self, observation: Observation, beams: NDArray[np.bool_]) -> None:
        """Note where a thing is that moves, and its velocity, if it is one thing."""
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
        """Return whether something that moves would come too near if the robot went."""
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
        # Both move: the least distance along the way, in steps of a quarter second. Who
        # stands in its way gains nothing by standing.
        driving = np.abs(ends[:, None] + (velocity - going) * times).min()
        standing = np.abs(ends[:, None] + velocity * times).min()
        return bool(driving < min(self._bumpers.pressed_below, standing))


def _add_to_track(
    track: deque[tuple[float, complex]], now: float, place: complex
) -> complex:
    """Add when and where something is; return its velocity, m/s, 0 until known."""
    track.append((now, place))
    while now - track[0][0] > INTERVAL:
        track.popleft()
    begin, first = track[0]
    # A track of one or two scans gives any velocity, by noise.
    return (place - first) / (now - begin) if now - begin >= LEAST_TRACK else 0j
