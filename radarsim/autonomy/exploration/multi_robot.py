"""Several robots that explore at once, each by its own connection, and make one map.

The robots are stepped in turn, one scan of each: in lockstep with a server in the same
process the same seed gives the same map. What one of them has sensed is known to all as
soon as it is known where their maps are on each other (``shared_map``).

The map merger finds where the maps of the robots are on the one that they share.

What a robot has seen is compared with what all robots on the shared map have seen. A
map that is not there yet is tried again whenever robots have gone on a little, each
time at another place of its robot's path. One that is there is fitted again now and
then, as what was seen since tells more. If it contradicts another one by then, or has
moved farther than start poses may be off, it is taken off: of two that contradict each
other both, unless one is the first robot's, as nobody knows which of them is wrong.
"""

from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from itertools import combinations
from typing import Final, TypeAlias

import numpy as np

from radarsim.autonomy.exploration.exploration import (
    Exploration,
    ExplorationStep,
    Outcome,
)
from radarsim.autonomy.exploration.path_follower import ExplorationSettings
from radarsim.autonomy.exploration.plans import ExplorationPlan, StrategyName
from radarsim.autonomy.exploration.strategies import find_unexplored
from radarsim.autonomy.exploration.target_allocation import (
    SharedTargetStrategy,
    TargetBoard,
)
from radarsim.autonomy.mapping.loop_closure import Keyframe, KeyframeMap
from radarsim.autonomy.mapping.map_alignment import (
    VIEWS,
    align,
    fits,
    is_allowed,
    is_sole,
    placed,
    refine,
)
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.mapping.scan_grid import ORIGIN, RobotMap, SharedMap
from radarsim.autonomy.mapping.slam import FIRST_KEYFRAMES
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.navigation.runner import TripMeter
from radarsim.client import Client
from radarsim.errors import ClientError, ClientTimeout, NavigationError, expected_one_of
from radarsim.geometry import Point, wrap_angle

RETRY: Final = 1.0  # m of path, of it and of others, between two attempts to align one
REFINE: Final = 5.0  # m, likewise, after which one that is aligned is fitted anew
NEWS: Final = 0.01, 0.001  # m and rad by which a map has to be off for that to count
STRATEGIES: Final = (StrategyName.AUTO, StrategyName.FRONTIERS)


class MapMerger:
    """Aligns the maps of robots, of which the first one's is the shared map."""

    def __init__(self, robots: Sequence[Exploration], maps: Sequence[RobotMap]) -> None:
        """Begin with the robots' maps, which may still be empty.

        Args:
            robots: The run of each robot.
            maps: The map of each robot that has joined, in the same order.
        """
        self._robots = robots
        self._maps = maps
        self._next_station = [0.0] * len(robots)
        self._attempts = [0] * len(robots)

    def step(self, number: int) -> None:
        """Align the map of a robot after a scan, if it is time to."""
        known = self._keyframes(number)
        # The first robot's map is the shared one. The first keyframes are all of one
        # place, which tells too little.
        if number == 0 or len(known) < FIRST_KEYFRAMES:
            return
        station = self._station(number)
        if station < self._next_station[number]:
            return
        if self._maps[number].frame is not None:
            self._next_station[number] = station + REFINE
            self._refine(number)
            self._check(self._wrong, self._contradicted)
            return
        self._next_station[number] = station + RETRY
        if self._try_to_align(number):
            self._next_station[number] = station + REFINE
            self._check(self._wrong, self._contradicted)

    def refine_all(self) -> bool:
        """Fit all aligned maps again; return whether any of them has moved."""
        moved = [self._refine(number) for number in range(1, len(self._maps))]
        return self._check_all() or any(moved)

    def finish(self) -> None:
        """Align all maps with what is known at the end."""
        self.refine_all()
        for number in range(1, len(self._maps)):
            if self._maps[number].frame is None and len(self._keyframes(number)):
                # Until one succeeds; each attempt looks at another place.
                any(self._try_to_align(number) for _ in range(VIEWS))
                self._refine(number)
        self._check_all()

    def _try_to_align(self, number: int) -> bool:
        """Find where the robot's map is on the shared one; return whether it is known.

        Each attempt looks at another place.
        """
        map_, attempt = self._maps[number], self._attempts[number]
        self._attempts[number] += 1
        reference = self._reference(number)
        frame = align(reference, self._keyframes(number), map_.frame_pose, attempt)
        if frame is None:
            return False
        map_.align(frame)
        for other in set(range(len(self._maps))) - set(self._placed()):
            self._next_station[other] = 0.0  # what this one has seen may place it, too
        return True

    def _refine(self, number: int) -> bool:
        """Fit an aligned map again; return whether it has moved."""
        map_, reference = self._maps[number], self._reference(number)
        if map_.frame is None or not reference:
            return False
        frame = refine(reference, self._keyframes(number), map_.frame)
        if frame is None:
            return False
        x, y, yaw = frame.x - map_.frame.x, frame.y - map_.frame.y, frame.yaw
        # Each move builds the shared grid anew, so one that hardly shows is none.
        distance, angle = NEWS
        is_turned = abs(wrap_angle(yaw - map_.frame.yaw)) > angle
        if np.hypot(x, y) <= distance and not is_turned:
            return False
        map_.align(frame)
        return True

    def _check_all(self) -> bool:
        """Undo those, too, that are no longer sure, which takes longer to find out."""
        return self._check(self._wrong, self._contradicted, self._unsure)

    def _check(self, *checks: Callable[[], list[int]]) -> bool:
        """Undo alignments that have turned out to be wrong; return whether any has."""
        found = False
        # Those first that are wrong for sure, as others may contradict these alone.
        for find_wrong in checks:
            for number in find_wrong():
                self._maps[number].undo_alignment()
                # With what is known now, the next attempt would end as this one did.
                self._next_station[number] = self._station(number) + RETRY
                found = True
        return found

    def _wrong(self) -> list[int]:
        """Return the robots whose maps contradict the first one, or their start."""
        return [
            number
            for number in self._placed()
            if number
            and not (
                is_allowed(
                    self._maps[number].frame_pose, self._keyframes(number), ORIGIN
                )
                and self._fits(0, number)
            )
        ]

    def _contradicted(self) -> list[int]:
        """Return the robots whose maps contradict each other."""
        pairs = combinations([number for number in self._placed() if number], 2)
        return sorted(
            {each for pair in pairs if not self._fits(*pair) for each in pair}
        )

    def _unsure(self) -> list[int]:
        """Return the robots whose maps would fit elsewhere as well by now."""
        return [
            number
            for number in self._placed()
            if number
            and (reference := self._reference(number))
            and not is_sole(
                reference,
                self._keyframes(number),
                self._maps[number].frame_pose,
                ORIGIN,
            )
        ]

    def _fits(self, one: int, other: int) -> bool:
        if not len(self._keyframes(one)):
            return True
        others = [self._on_map(k) for k in self._placed() if k not in (one, other)]
        robots = [each for keyframes in others for each in keyframes]
        known, frame = self._keyframes(other), self._maps[other].frame_pose
        return fits(self._on_map(one), known, frame, robots)

    def _station(self, number: int) -> float:
        """Return the length of the way of a robot and of all that are placed, m."""
        # A robot that waits sees nothing new, but others may come to where it was.
        known = [self._keyframes(k).keyframes for k in {*self._placed(), number}]
        return sum(each[-1].station for each in known if each)

    def _reference(self, number: int) -> list[Keyframe]:
        others = [self._on_map(k) for k in self._placed() if k != number]
        return [each for keyframes in others for each in keyframes]

    def _on_map(self, number: int) -> list[Keyframe]:
        return placed(self._keyframes(number), self._maps[number].frame_pose)

    def _placed(self) -> list[int]:
        return [k for k, map_ in enumerate(self._maps) if map_.frame is not None]

    def _keyframes(self, number: int) -> KeyframeMap:
        mapper = self._robots[number].mapper
        return KeyframeMap() if mapper is None else mapper.slam.keyframes


Observer: TypeAlias = Callable[[int, ExplorationStep], None]


class MultiRobotExploration:
    """One run of several robots and its results, which remain if it fails.

    Attributes:
        plan: The plan of each robot.
        shared: The map.
        robots: The run of each robot, which holds its trajectory.
        maps: The map of each robot, which tells where it is on the shared one.
        errors: Why each robot drove no longer; empty where nothing went wrong.
        outcome: How the run ended; ``broken_off`` while it lasts.
        unreached: A place in each piece of floor that is left, m.
    """

    def __init__(self, plan: ExplorationPlan, robots: int) -> None:
        """Create a run that has not begun.

        Args:
            plan: The plan of each robot, without waypoints and pose; ``start`` is that
                of the first one, and the next ones begin at the starts that follow.
            robots: Number of robots.

        Raises:
            ValueError: If several robots cannot do what the plan says.
        """
        if plan.strategy not in STRATEGIES or plan.waypoints or plan.pose is not None:
            names = " or ".join(STRATEGIES)
            raise ValueError(f"several robots, expected {names}, no waypoints, no pose")
        self.plan = plan
        self.shared = SharedMap(plan.resolution)
        self.outcome = Outcome.BROKEN_OFF
        self.unreached: tuple[Point, ...] = ()
        self.errors = [""] * robots
        self._board = TargetBoard(robots)
        self.robots = [self._exploration(k) for k in range(robots)]
        self._merger = MapMerger(self.robots, self.maps)
        self._latest: dict[int, Observation] = {}

    @property
    def maps(self) -> Sequence[RobotMap]:
        """The map of each robot that is known."""
        return self.shared.robots

    @property
    def mapper(self) -> Mapper | None:
        """The mapper of the first robot, whose map is the shared one."""
        return self.robots[0].mapper

    @property
    def trip(self) -> TripMeter:
        """Time so far, the way of all robots, and where the first one began."""
        trip = TripMeter()
        trip.start = self.robots[0].trip.start
        trip.time = max(robot.trip.time for robot in self.robots)
        trip.length = sum(robot.trip.length for robot in self.robots)
        return trip

    @property
    def safety_distance(self) -> float:
        """Distance kept from obstacles, m; nan before the first robot is known."""
        return self.robots[0].safety_distance

    def run(
        self, clients: Sequence[Client], observe: Observer = lambda *_: None
    ) -> None:
        """Spawn the robots and let them explore; they stand still at the end.

        Args:
            clients: A connection without a robot for each.
            observe: Called at every scan with the number of the robot.

        Raises:
            ClientError: If the server does not send what is needed.
            MappingError: If no map can be made of what it sends.
            NavigationError: If no robot can do what is asked of it.
        """
        try:
            self._place(clients[0])
            with ExitStack() as stack:
                steps = [
                    stack.enter_context(closing(robot.steps(client)))
                    for robot, client in zip(self.robots, clients, strict=True)
                ]
                self._drive(steps, observe)
        except BaseException:
            outcomes = [robot.outcome for robot in self.robots]
            # In this order, as a failure says more than a robot that is stuck.
            for outcome in (Outcome.STUCK, Outcome.FAILED):
                if outcome in outcomes:
                    self.outcome = outcome
            raise
        finally:
            # with what is known now of where the robots were
            self._merger.finish()
            for map_ in self.maps:
                map_.finish()
        self._conclude()

    def _exploration(self, number: int) -> Exploration:
        def strategy(settings: ExplorationSettings) -> SharedTargetStrategy:
            fills = self.plan.strategy is StrategyName.AUTO
            return SharedTargetStrategy(settings, self._board, number, fills=fills)

        rng = np.random.Generator(np.random.PCG64(0))  # no strategy uses it
        return Exploration(self.plan, rng, join=self.shared.join, strategy=strategy)

    def _place(self, client: Client) -> None:
        """Choose the starts of all robots.

        Raises:
            NavigationError: If the map has too few.
        """
        names = list(client.start_poses())
        wanted = self.plan.start
        folded = [name.casefold() for name in names]
        if wanted is not None and wanted.casefold() not in folded:
            raise NavigationError(f"start {expected_one_of(wanted, names)}")
        first = 0 if wanted is None else folded.index(wanted.casefold())
        if len(names) < len(self.robots):
            raise NavigationError(
                f"map with {len(names)} start pose{'s' * (len(names) != 1)}, expected"
                f" {len(self.robots)}, one for each robot: add starts to the map"
            )
        for k, robot in enumerate(self.robots):
            name = names[(first + k) % len(names)]
            robot.plan = replace(robot.plan, start=name)

    def _drive(
        self, steps: Sequence[Generator[ExplorationStep]], observe: Observer
    ) -> None:
        driving = dict(enumerate(steps))
        while driving:
            # One scan of each in turn: in lockstep the same seed gives the same map.
            for number, robot_steps in list(driving.items()):
                was_searching = bool(self._board.searching)
                step = self._next(number, robot_steps, is_last=len(driving) == 1)
                if step is None:
                    del driving[number]
                else:
                    self._latest[number], pose = step.observation, step.observation.pose
                    is_on_map = self.maps[number].is_merged
                    self._board.note_pose(number, pose, is_on_map=is_on_map)
                    observe(number, step)
                    self._merger.step(number)
                # Nobody finds a target any more: but what they have explored may not
                # be the whole once all maps fit, so they look again if one has moved.
                if not was_searching or self._board.searching:
                    continue
                if self._merger.refine_all() or self.shared.is_rebuilding:
                    self.shared.finish()
                    self._board.searching.update(driving)

    def _next(
        self, number: int, steps: Generator[ExplorationStep], *, is_last: bool
    ) -> ExplorationStep | None:
        """Return the next step of a robot; None if it drives no more.

        One that gets stuck, or whose connection is lost, leaves the rest to others.
        """
        try:
            step = next(steps, None)
        except (ClientError, NavigationError) as error:
            self.errors[number] = str(error)
            if self.robots[number].trip.start is None:
                # The first robot gets scans and this one none: that is how a second
                # robot with an FMCW radar ends.
                is_timeout = isinstance(error, ClientTimeout)
                if is_timeout and self.robots[0].trip.start is not None:
                    raise ClientTimeout(
                        f"robot {number + 1} at {self.robots[number].plan.start}:"
                        f" {error}; of FMCW radars only one antenna turns in a server:"
                        " with these, expected one robot, or a robot class with another"
                        " scanner"
                    ) from error
                raise
            if is_last:
                raise
            step = None
        if step is None:
            # Others may drive to its target now.
            self._board.leave(number)
        return step

    def _conclude(self) -> None:
        is_over = any(robot.outcome is Outcome.TIME_LIMIT for robot in self.robots)
        self.outcome = Outcome.TIME_LIMIT if is_over else Outcome.EXPLORED
        first = self.robots[0]
        settings, start = first.settings, first.trip.start
        if is_over or settings is None or start is None:
            return
        latest = [
            observation
            for number, observation in self._latest.items()
            if self.maps[number].frame is not None
        ]
        left = find_unexplored(latest, self.shared.grid, settings, start)
        self.unreached = tuple(left.frontiers + left.cut_off)
        is_whole = all(each.frame is not None for each in self.maps)
        if left.frontiers or not is_whole:
            self.outcome = Outcome.INCOMPLETE
