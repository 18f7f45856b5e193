"""From a connection to a map: spawn a robot, ask what it is, and let it explore."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from radarsim.client import Client, DriveUnit, RobotInfo, ScannerInfo
from radarsim.errors import ClientError, MappingError, NavigationError
from radarsim.exploration.options import StrategyName
from radarsim.exploration.path_follower import (
    ExplorationSettings,
    Strategy,
    WaypointFollower,
)
from radarsim.exploration.strategies import create_strategy
from radarsim.exploration.traversability import Point, TraversabilityMap
from radarsim.geometry import Pose2, Pose3
from radarsim.mapping.mapper import Mapper, MapperSettings
from radarsim.mapping.occupancy_grid import RESOLUTION
from radarsim.mapping.point_map import PointMap
from radarsim.mapping.slam import MotionSource, SlamSettings
from radarsim.navigation.bumpers import Bumpers
from radarsim.navigation.control import (
    ControlLoop,
    SpeedLimits,
    StandstillDetector,
    StuckDetector,
    Twist,
    check_beams,
)
from radarsim.navigation.mission import (
    check_field_of_view,
    choose_start,
    safety_distance_for,
)
from radarsim.navigation.observation import Observation
from radarsim.navigation.options import ROBOT
from radarsim.navigation.runner import TripMeter
from radarsim.protocol.reports import EchoLine, Ins, RangeScan, Report, TargetEchoes

RADIUS = 12.0  # m
TIME_LIMIT = 3600.0  # s
NOISE = 0.05  # m; poses that are found differ by less while the robot stands


class Outcome(StrEnum):
    """How a survey ended."""

    EXPLORED = "explored"
    TIME_LIMIT = "time_limit"
    STUCK = "stuck"
    FAILED = "failed"  # the server said no more what is needed
    BROKEN_OFF = "broken_off"


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplorationPlan:
    """What to map, and how.

    Attributes:
        strategy: Of exploring.
        waypoints: Points to drive to in turn instead, m, map frame; empty for the
            strategy.
        motion_source: What tells the robot's motion between scans.
        echoes: Whether to ask the server for them.
        resolution: Side of a cell of the map, m.
        robot_class: To be spawned; to explore, its scanner has to see all around.
        start: Name of a start pose; the server's first one if there is no pose either.
        pose: Where to start otherwise.
        scanner: Name of the scanner to map with; the first one by default.
        safety_distance: m from the robot's centre; None for the one that follows from
            ``penetration_depth``.
        penetration_depth: How far the sensor sees into foliage without knowing it, m.
        wall_on_left: Whether walls are followed on the left hand.
        speed_limits: How fast.
        radius: How far from its start it goes where there is no border, m.
        time_limit: s of the server.
        timeout: After so many s without a scan the run is given up.
        drive_unit: What the server counts wheel speeds in.
    """

    strategy: StrategyName = StrategyName.AUTO
    waypoints: tuple[Point, ...] = ()
    motion_source: MotionSource = "ins"
    echoes: bool = True
    resolution: float = RESOLUTION
    robot_class: str = ROBOT
    start: str | None = None
    pose: Pose2 | None = None
    scanner: str | None = None
    safety_distance: float | None = None
    penetration_depth: float = 0.0
    wall_on_left: bool = True
    speed_limits: SpeedLimits = field(default_factory=lambda: SpeedLimits(speed=0.4))
    radius: float = RADIUS
    time_limit: float = TIME_LIMIT
    timeout: float = 2.0
    drive_unit: DriveUnit = "rad_per_s"


@dataclass(frozen=True, slots=True)
class ExplorationStep:
    """One scan, and what the strategy made of it.

    Attributes:
        observation: What was known.
        activity: What the strategy is at, in a word.
        twist: What it wants.
    """

    observation: Observation
    activity: str
    twist: Twist


class Exploration:
    """One run, and what is known of it, also where it broke off.

    Attributes:
        plan: What to do.
        mapper: Has the map and the trajectory; None before the robot is known.
        outcome: How it ended; ``broken_off`` while it lasts.
        safety_distance: That is kept, m; nan before the robot is known.
        trip: How far it has come.
    """

    def __init__(self, plan: ExplorationPlan, rng: np.random.Generator) -> None:
        """Get ready.

        Args:
            plan: What to do.
            rng: For strategies that leave something to chance.
        """
        self.plan = plan
        self.mapper: Mapper | None = None
        self.outcome = Outcome.BROKEN_OFF
        self.safety_distance = math.nan
        self.trip = TripMeter(noise=NOISE)
        self._rng = rng
        self._strategy: Strategy | None = None

    @property
    def unreached(self) -> tuple[Point, ...]:
        """The places of the way that it could not get to, m."""
        way = self._strategy
        return tuple(way.unreached) if isinstance(way, WaypointFollower) else ()

    def run(
        self,
        client: Client,
        observe: Callable[[ExplorationStep], None] = lambda _: None,
    ) -> None:
        """Spawn a robot and let it explore; it stands at the end.

        Args:
            client: A connection without a robot.
            observe: Called at every scan.

        Raises:
            ClientError: If the server does not say what is needed.
            MappingError: If no map can be made of what it says.
            NavigationError: If the robot cannot do what is asked of it.
        """
        warm_up()  # who compiles while the robot moves lets it go on blindly
        try:
            helm, strategy = self._prepare(client)
            self._explore(helm, strategy, observe)
        except (ClientError, MappingError):
            self.outcome = Outcome.FAILED
            raise
        except NavigationError:
            stuck = self.trip.start is not None
            self.outcome = Outcome.STUCK if stuck else Outcome.FAILED
            raise
        finally:
            client.stop()

    def _prepare(self, client: Client) -> tuple[ControlLoop, Strategy]:
        plan = self.plan
        start = None if plan.pose is not None else choose_start(client, plan.start)
        client.spawn(plan.robot_class, start=start, pose=plan.pose)
        facts = client.robot_info(drive_unit=plan.drive_unit)
        scanner = facts.scanner(plan.scanner)
        settings = self._settings_for(facts)
        if not plan.waypoints:
            check_field_of_view(settings.bumpers, scanner)
        if plan.echoes:
            client.echoes(scanner.name)
        mapper_settings = MapperSettings(
            slam=SlamSettings(motion_source=plan.motion_source),
            resolution=plan.resolution,
            echo_wait=1.0 if plan.echoes else 0.0,
            body=min(facts.length, facts.width) / 2,
        )
        self.mapper = Mapper(scanner, mapper_settings, clock=client.transport.time)
        strategy = self._strategy_with(settings)
        return ControlLoop(client, facts, self.mapper, timeout=plan.timeout), strategy

    def _strategy_with(self, settings: ExplorationSettings) -> Strategy:
        plan = self.plan
        if plan.waypoints:
            self._strategy = WaypointFollower(settings, plan.waypoints)
        else:
            self._strategy = create_strategy(plan.strategy, settings, self._rng)
        return self._strategy

    def _settings_for(self, facts: RobotInfo) -> ExplorationSettings:
        plan = self.plan
        safety = safety_distance_for(
            facts, plan.safety_distance, plan.penetration_depth
        )
        self.safety_distance = safety
        return ExplorationSettings(
            bumpers=Bumpers(safety_distance=safety),
            speed_limits=SpeedLimits(
                min(plan.speed_limits.speed, facts.top_speed), plan.speed_limits.turn
            ),
            wall_on_left=plan.wall_on_left,
            radius=plan.radius,
        )

    def _explore(
        self,
        helm: ControlLoop,
        strategy: Strategy,
        observe: Callable[[ExplorationStep], None],
    ) -> None:
        assert self.mapper is not None
        push, standstill = StuckDetector(), StandstillDetector()
        for observation in helm.scans():
            check_beams(len(observation.bearings), self.mapper.scanner)
            self.trip.add(observation)
            twist = strategy.step(observation, self.mapper.grid)
            observe(ExplorationStep(observation, strategy.activity, twist))
            if strategy.is_done or self.trip.time > self.plan.time_limit:
                done = strategy.is_done
                self.outcome = Outcome.EXPLORED if done else Outcome.TIME_LIMIT
                return
            push.check(observation, twist)
            standstill.check(observation)
            helm.drive(twist)


# Section from mapping.warming.
# Compiling what maps are made by, before a robot moves.
#
# The first use of a compiled function on a machine takes seconds. A robot that has
# been
# told to go would go on blindly for as long.

_BEAMS = 90
_FOV = math.radians(356)
_SCANNER = ScannerInfo("x", Pose3(0, 0, 0), 0.1, 6.0, math.radians(4), _FOV, _BEAMS)
_SCANS = 3
_MANY = 1000  # points, more than a new map has room for


def warm_up() -> None:
    """Make a little map, with and without a seed, and plan on it."""
    PointMap().add(np.zeros((_MANY, 2)))
    for settings in (SlamSettings(), SlamSettings(motion_source="none")):
        mapper = Mapper(_SCANNER, MapperSettings(slam=settings, body=0.2))
        for report in _drive():
            mapper.take(report)
        floor = TraversabilityMap(mapper.grid, 0.4)
        middle = Pose2(0.0, 0.0)
        floor.find_path(middle, floor.frontiers | floor.unvisited)
        floor.outer_boundary(floor.reachable(middle))
        mapper.grid.drivable_cells(0.4)


def _drive() -> Iterator[Report]:
    """Tell of a robot inside a wall all round, with a hedge before it on one side."""
    beams = np.arange(_BEAMS // 2)
    for k in range(_SCANS):
        time = 0.1 * k
        yield Ins(time, "x", Pose3(0.3 * k, 0.0, 0.0))
        yield EchoLine(time, "x", 1, 2, _seen("wall", np.arange(_BEAMS), 5.0, "hit"))
        yield EchoLine(time, "x", 2, 2, _seen("hedge", beams, 3.0, "enter"))
        ranges = np.full(_BEAMS, 5.0)
        yield RangeScan(time, "x", math.radians(4), _FOV, ranges)


def _seen(
    name: str, beams: NDArray[np.int64], range_: float, kind: str
) -> TargetEchoes:
    ones = np.ones(len(beams))
    kinds, flags = (kind,) * len(beams), (False, False)
    return TargetEchoes(
        name, name, 1.0, 0.5, *flags, beams, range_ * ones, kinds, ones, ones
    )
