"""Exploration: spawn a robot, request its sensors, and map its surroundings."""

import math
from collections.abc import Callable
from enum import StrEnum

import numpy as np

from radarsim.autonomy.exploration.path_follower import (
    WAITING,
    ExplorationSettings,
    WaypointFollower,
)
from radarsim.autonomy.exploration.revisit import Revisit
from radarsim.autonomy.exploration.strategies import create_strategy
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.control import (
    ControlLoop,
    StandstillDetector,
    StuckDetector,
)
from radarsim.autonomy.navigation.mission import check_field_of_view, spawn_robot
from radarsim.autonomy.navigation.observation import check_beams
from radarsim.autonomy.navigation.runner import TripMeter
from radarsim.autonomy.plans import ExplorationPlan, StrategyName
from radarsim.client import Client
from radarsim.errors import ClientError, MappingError, NavigationError
from radarsim.geometry import Point

NOISE = 0.05  # m; estimated poses of a standing robot differ by less


class Outcome(StrEnum):
    """The outcome of an exploration."""

    EXPLORED = "explored"  # no reachable target is left
    INCOMPLETE = "incomplete"  # the strategy ended with frontiers left
    TIME_LIMIT = "time_limit"
    STUCK = "stuck"
    FAILED = "failed"  # the server did not send required reports
    BROKEN_OFF = "broken_off"


class Exploration:
    """One exploration and its results, which remain available after an error.

    Attributes:
        plan: The plan of the exploration.
        mapper: The map and the trajectory; None before the robot is spawned.
        outcome: How the run ended; ``broken_off`` while it runs.
        safety_distance: Distance kept from obstacles, m; nan before the robot is
            spawned.
        trip: Time and path length so far.
        unreached: Waypoints that the robot could not reach, m; after exploring, a point
            in each remaining piece of floor where the robot would fit.
    """

    def __init__(self, plan: ExplorationPlan, rng: np.random.Generator) -> None:
        """Create a run.

        Args:
            plan: The plan of the exploration.
            rng: Random generator for strategies that use chance.
        """
        self.plan = plan
        self.mapper: Mapper | None = None
        self.outcome = Outcome.BROKEN_OFF
        self.safety_distance = math.nan
        self.trip = TripMeter(noise=NOISE)
        self._rng = rng
        self.unreached: tuple[Point, ...] = ()

    def run(
        self,
        client: Client,
        observe: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Spawn a robot and let it explore; stop the robot at the end.

        Args:
            client: Connection without a robot.
            observe: Called at every scan, after the motion command, with the activity
                of the strategy in one word.

        Raises:
            ClientError: If the server does not send required reports.
            MappingError: If no map can be made from the reports.
            NavigationError: If the robot cannot carry out the plan, or gets stuck.
        """
        try:
            loop, strategy = self._prepare(client)
            self._explore(loop, strategy, observe)
        except (ClientError, MappingError):
            self.outcome = Outcome.FAILED
            raise
        except NavigationError:
            # An error before the first scan means that the server rejected the robot.
            has_started = self.trip.start is not None
            self.outcome = Outcome.STUCK if has_started else Outcome.FAILED
            raise
        finally:
            try:
                client.stop()
            finally:  # an interrupt may come before the command is sent
                if self.mapper is not None:
                    self.mapper.finish()

    def _prepare(
        self, client: Client
    ) -> tuple[ControlLoop, WaypointFollower | Revisit]:
        """Spawn the robot; return the control loop and the exploration strategy."""
        plan = self.plan
        info, scanner, self.safety_distance, speed_limits = spawn_robot(client, plan)
        settings = ExplorationSettings(
            bumpers=Bumpers(safety_distance=self.safety_distance),
            speed_limits=speed_limits,
            plan=plan,
        )
        if not plan.waypoints:
            check_field_of_view(settings.bumpers, scanner)
        if plan.echoes:
            client.echoes(scanner.name)
        # At any heading, the robot covers the disc of this radius.
        radius = min(info.length, info.width) / 2
        self.mapper = Mapper(
            scanner,
            motion_source=plan.motion_source,
            resolution=plan.resolution,
            map_range=plan.map_range,
            echo_wait=1.0 if plan.echoes else 0.0,
            robot_radius=radius,
            clock=client.transport.time,
        )
        loop = ControlLoop(client, info, self.mapper, timeout=plan.timeout)
        if plan.waypoints:
            return loop, WaypointFollower(settings, plan.waypoints)
        strategy = create_strategy(plan.strategy, settings, self._rng)
        fills = plan.strategy is not StrategyName.FRONTIERS
        return loop, Revisit(settings, strategy, fills=fills)

    def _explore(
        self,
        loop: ControlLoop,
        strategy: WaypointFollower | Revisit,
        observe: Callable[[str], None],
    ) -> None:
        assert self.mapper is not None
        stuck, standstill = StuckDetector(), StandstillDetector()
        for observation in loop.scans():
            check_beams(len(observation.bearings), self.mapper.scanner)
            self.trip.add(observation)
            twist = strategy.step(observation, self.mapper.grid)
            self.unreached = tuple(strategy.unreached)
            is_over = strategy.is_done or self.trip.time > self.plan.time_limit
            if not is_over:
                loop.drive(twist)  # before ``observe``, which may take long
            observe(strategy.activity)
            if is_over:
                is_done, grid = strategy.is_done, self.mapper.grid
                self.outcome = Outcome.EXPLORED if is_done else Outcome.TIME_LIMIT
                if isinstance(strategy, Revisit):
                    if is_done:
                        frontiers, cut_off = strategy.find_unexplored(observation, grid)
                        if frontiers or self.unreached:
                            self.outcome = Outcome.INCOMPLETE
                        self.unreached = (*frontiers, *cut_off, *self.unreached)
                    self.mapper.finish()
                    strategy.forget_moved(self.mapper.grid)
                return
            stuck.check(observation, twist)
            # While the robot waits, it may stand still
            # for a long time, so the detector is reset.
            if strategy.activity == WAITING:
                standstill = StandstillDetector()
            standstill.check(observation)
