"""Plans of autonomous robots, and the names of their algorithms.

A new algorithm is a subclass of ``Controller``, with a member of ``Algorithm`` here and
an entry in ``mission.CONTROLLERS``. Command lines import this module for these names,
so it imports no slow packages.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, ClassVar, Final, Literal, TypeAlias

from annotated_types import Gt, Interval, Unit

from radarsim.geometry import Pose2
from radarsim.plans import RARE, Form, Option, PointXY, Sets, read_numbers
from radarsim.protocol.dialect import DriveUnit

ROBOT: Final = "P3AT_Radar360"  # a robot class whose scanner covers a full circle
ROBOT_RADIUS: Final = 0.37  # m; half the diagonal of a P3AT
LEAST_SHARE = 0.1  # share of a bumper's beams
TOLERANCE = 0.1  # m from the goal, within which it is reached


class Algorithm(StrEnum):
    """Navigation algorithms."""

    BUG1 = "bug1"
    BUG2 = "bug2"
    TANGENT_BUG = "tangentbug"  # drives over edges of obstacles that scans show
    PLANNED = "planned"  # shortest path on a map of the seen obstacles


class Rule(StrEnum):
    """Rules that decide when a bumper is pressed, and how boundaries are followed."""

    SHARE = "share"  # a share of its beams is shorter than the far end of the band
    ALL = "all"  # all of its beams end in the band, as in the thesis
    THESIS = "thesis"  # as ``all``, and boundaries are followed by bumpers alone


class GiveUp(StrEnum):
    """Conditions under which Bug2 concludes that no path exists."""

    HIT_POINT = "hit_point"  # back at the hit point
    LINE = "line"  # at the line to the goal, but no nearer to the goal


class PoseSource(StrEnum):
    """Sources of the robot's pose."""

    INS = "ins"
    ODOMETRY = "odometry"
    GROUND_TRUTH = "ground_truth"
    SLAM = "slam"  # scans matched with previous scans, and the motion of an INS


class StrategyName(StrEnum):
    """Exploration strategies."""

    AUTO = "auto"
    TURN_AWAY = "turn_away"
    CONTOUR = "contour"
    CENTRE_OUT = "centre_out"
    FRONTIERS = "frontiers"


def read_pose(text: str) -> Pose2:
    """Read ``X,Y,YAW_DEG``.

    Raises:
        ValueError: If the text is not three finite numbers.
    """
    x, y, yaw_deg = read_numbers(text)
    return Pose2(x, y, math.radians(yaw_deg))


def read_heading(text: str) -> float:
    """Read an angle in degrees, counter-clockwise from x; return rad.

    Raises:
        ValueError: If the text is not one finite number.
    """
    (degrees,) = read_numbers(text)
    return math.radians(degrees)


# Sources of the motion between scans.
MotionSource: TypeAlias = Literal["ins", "odometry", "none"]
Metres: TypeAlias = Annotated[float, Gt(0), Unit("m")]
Seconds: TypeAlias = Annotated[float, Gt(0), Unit("s")]
MapPose: TypeAlias = Annotated[Pose2, Form("X,Y,YAW_DEG", read_pose)]
Heading: TypeAlias = Annotated[float, Form("DEG", read_heading)]


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivePlan:
    """Base class of plans for a robot that drives autonomously.

    Attributes:
        robot_class: Class of the robot; its scanner must cover a full circle.
        start: Name of a start pose; by default the first free one.
        pose: Start pose in the map frame, m and degrees.
        scanner: Name of the scanner to use; by default the first one.
        safety_distance: Least distance of the robot's centre from obstacles; by default
            0.13 m more than size and foliage require.
        foliage_density: Density of the thinnest foliage, 1/m; without echoes, it adds
            the radar's penetration depth to the safety distance.
        penetration_power: Penetration depth in foliage, m, times the foliage density.
        echoes: Get the echoes of each beam, which show obstacles such as foliage even
            if the beam penetrates them; with --no-echoes, only ranges are used.
        speed: Top speed, at most the robot's.
        turn_speed: Maximum turn rate on the spot.
        side: Side of the robot on which the followed boundary is kept.
        drive_unit: Unit of wheel speeds that the server expects.
        timeout: End the run as failed after this time without a scan.
        time_limit: Maximum duration in simulated time.
    """

    option_group: ClassVar = "Robot"
    at_most_one: ClassVar[Sets] = (("start", "pose"),)

    robot_class: Annotated[str, Option(names=("--robot",), words="robots")] = ROBOT
    start: str | None = None
    pose: MapPose | None = None
    scanner: Annotated[str | None, RARE] = None
    safety_distance: Metres | None = None
    foliage_density: Annotated[float | None, Gt(0), Unit("per_m"), RARE] = None
    penetration_power: Annotated[float, Gt(0), RARE] = 1.0
    echoes: Annotated[bool, RARE] = True
    speed: Annotated[float, Gt(0), Unit("m/s")] = 0.3
    turn_speed: Annotated[float, Gt(0), Unit("rad/s"), RARE] = 0.8
    side: Annotated[Literal["left", "right"], RARE] = "left"
    drive_unit: Annotated[DriveUnit, RARE] = "rad_per_s"
    timeout: Annotated[Seconds, RARE] = 2.0
    time_limit: Annotated[Seconds, Option(may_be_infinite=True)] = 3600.0

    @property
    def penetration_depth(self) -> float:
        """Depth to which a radar sees into foliage, m; 0 if no density is given."""
        if self.foliage_density is None:
            return 0.0
        return self.penetration_power / self.foliage_density


@dataclass(frozen=True, slots=True, kw_only=True)
class Mission(DrivePlan):
    """A navigation mission.

    Attributes:
        algorithm: Navigation algorithm; 'planned' searches paths on a grid of the
            sensed obstacles.
        goals: Goal in the map frame, m; repeat the option for several, in order.
        heading: Heading at the last goal, counter-clockwise from x.
        return_to_start: Drive back to the start after the last goal.
        bumpers: Number of virtual bumpers, which are sectors of the scanner's beams.
        share: Share of a bumper's beams that must be near an obstacle to press it.
        rule: Rule for pressing bumpers and following boundaries; see 'radarsim docs
            navigation'.
        give_up: Where Bug2 finds that there is no path: back at the hit point, or at
            the line from start to goal, but no nearer to the goal.
        pose_source: Source of the pose: a sensor, or SLAM, which matches each scan with
            previous scans.
        tolerance: Distance from a goal at which the goal is reached.
    """

    option_group: ClassVar = "Mission"

    algorithm: Algorithm
    goals: Annotated[tuple[PointXY, ...], Option(names=("--goal",))] = ()
    heading: Heading | None = None  # rad
    return_to_start: bool = False
    bumpers: Annotated[int, Interval(ge=4, le=36), RARE] = 8
    share: Annotated[float, Interval(gt=0, le=1), RARE] = LEAST_SHARE
    rule: Annotated[Rule, RARE] = Rule.SHARE
    give_up: Annotated[GiveUp, RARE] = GiveUp.HIT_POINT
    pose_source: Annotated[PoseSource, Option(names=("--pose-from",), is_rare=True)] = (
        PoseSource.INS
    )
    tolerance: Annotated[Metres, RARE] = TOLERANCE


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplorationPlan(DrivePlan):
    """Plan of an exploration; with waypoints, the scanner need not cover a full circle.

    Attributes:
        strategy: Exploration strategy.
        waypoints: Waypoint to drive to instead; can be repeated.
        motion_source: Source of the motion between scans: a sensor, or scans alone.
        resolution: Side length of map cells.
        map_range: Maximum range of readings that are mapped; readings beyond it are
            still used for the pose.
        radius: Maximum distance from the start if no walls limit the exploration.
    """

    option_group: ClassVar = "Exploration"
    at_most_one: ClassVar = (("start", "pose"), ("strategy", "waypoints"))

    strategy: StrategyName = StrategyName.AUTO
    waypoints: Annotated[tuple[PointXY, ...], Option(names=("--way",))] = ()
    motion_source: Annotated[
        MotionSource, Option(names=("--motion-from",), is_rare=True)
    ] = "ins"
    resolution: Annotated[float, Interval(ge=0.005, le=1), Unit("m")] = 0.05
    map_range: Annotated[float, Gt(0), Unit("m"), RARE] = math.inf
    radius: Annotated[Metres, RARE] = 12.0
    speed: Annotated[float, Gt(0), Unit("m/s")] = 0.4
