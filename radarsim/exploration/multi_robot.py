"""Several robots that explore at once, each by its own connection, and make one map.

The robots are stepped in turn, one scan of each: in lockstep with a server in the same
process the same seed gives the same map. What one of them has sensed is known to all as
soon as it is known where their maps are on each other (``shared_map``).
"""

from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from typing import Final, TypeAlias

import numpy as np

from radarsim.client import Client
from radarsim.errors import ClientError, ClientTimeout, NavigationError
from radarsim.exploration.exploration import (
    Exploration,
    ExplorationPlan,
    ExplorationStep,
    Outcome,
)
from radarsim.exploration.map_merger import MapMerger
from radarsim.exploration.options import StrategyName
from radarsim.exploration.path_follower import ExplorationSettings
from radarsim.exploration.target_allocation import SharedTargetStrategy, TargetBoard
from radarsim.exploration.traversability import Point
from radarsim.exploration.unexplored_area import find_unexplored
from radarsim.mapping.mapper import Mapper
from radarsim.mapping.shared_map import RobotMap, SharedMap
from radarsim.navigation.observation import Observation
from radarsim.navigation.runner import TripMeter
from radarsim.suggestions import expected_one_of

STRATEGIES: Final = (StrategyName.AUTO, StrategyName.FRONTIERS)

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
            self._note_failure()
            raise
        finally:
            self._finish()
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
        """Step all robots in turn until none drives any more."""
        driving = dict(enumerate(steps))
        while driving:
            for number, robot_steps in list(driving.items()):
                was_searching = bool(self._board.searching)
                step = self._next(number, robot_steps, is_last=len(driving) == 1)
                if step is None:
                    del driving[number]
                else:
                    self._note(number, step, observe)
                if was_searching and not self._board.searching:
                    self._look_again(driving)

    def _note(self, number: int, step: ExplorationStep, observe: Observer) -> None:
        """Note where a robot is after a step, and align its map if it is time to."""
        self._latest[number] = step.observation
        is_on_map = self.maps[number].is_merged
        self._board.note_pose(number, step.observation.pose, is_on_map=is_on_map)
        observe(number, step)
        self._merger.step(number)

    def _look_again(self, driving: Iterable[int]) -> None:
        """Let robots that found no target search again, if their maps are moved.

        What they have explored may not be the whole once all maps fit.
        """
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
                self._explain_missing_scans(number, error)
                raise
            if is_last:
                raise
            step = None
        if step is None:
            self._board.leave(number)
        return step

    def _explain_missing_scans(self, number: int, error: Exception) -> None:
        """Raise a clearer error if no scan of a robot came, but scans of the first one.

        Raises:
            ClientTimeout: If that is so.
        """
        if isinstance(error, ClientTimeout) and self.robots[0].trip.start is not None:
            raise ClientTimeout(
                f"robot {number + 1} at {self.robots[number].plan.start}: {error};"
                " of FMCW radars only one antenna turns in a server: with these,"
                " expected one robot, or a robot class with another scanner"
            ) from error

    def _finish(self) -> None:
        """Complete the map, with what is known now of where the robots were."""
        self._merger.finish()
        for map_ in self.maps:
            map_.finish()

    def _note_failure(self) -> None:
        """Note how a run ended that raised an error."""
        outcomes = [robot.outcome for robot in self.robots]
        for outcome in (Outcome.STUCK, Outcome.FAILED):
            if outcome in outcomes:
                self.outcome = outcome

    def _conclude(self) -> None:
        """Tell how the run ended, and what is left."""
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
