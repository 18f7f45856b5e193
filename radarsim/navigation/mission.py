"""From a connection to a goal: spawn a robot, ask what it is, and let a bug drive."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from radarsim.client import Client, DriveUnit, RobotInfo, ScannerInfo
from radarsim.errors import ClientTimeout, NavigationError
from radarsim.geometry import Pose2
from radarsim.navigation.bug import TOLERANCE, Bug, BugSettings, Point
from radarsim.navigation.bumpers import LEAST_SHARE, Bumpers
from radarsim.navigation.control import SpeedLimits
from radarsim.navigation.options import ROBOT, Algorithm, GiveUp, PoseSource, Rule
from radarsim.navigation.runner import NavigationStep, Navigator, Result

MARGIN = 0.13  # m on top of what is needed at least, for noise and for the way to stop


@dataclass(frozen=True, slots=True, kw_only=True)
class Mission:
    """What to do, and how.

    Attributes:
        algorithm: Bug1 or Bug2.
        goals: Way points in turn, the last one the goal, m, map frame.
        robot_class: To be spawned; its scanner has to see all around.
        start: Name of a start pose; the server's first one if there is no pose either.
        pose: Where to start otherwise.
        scanner: Name of the scanner to steer by; the first one by default.
        safety_distance: m from the robot's centre; None for the
            least that is safe with ``penetration_depth``.
        penetration_depth: How far the sensor sees into foliage, m.
        bumpers: How many.
        share: Of a bumper's beams that press it.
        rule: When a bumper is pressed.
        wall_on_left: Whether boundaries are kept on the left hand.
        give_up: When Bug2 says that there is no path.
        pose_source: Where poses come from.
        speed_limits: How fast.
        tolerance: How near a goal is there, m.
        time_limit: s of the server.
        timeout: After so many s without a scan the run is given up.
        drive_unit: What the server counts wheel speeds in.
    """

    algorithm: Algorithm
    goals: tuple[Point, ...]
    robot_class: str = ROBOT
    start: str | None = None
    pose: Pose2 | None = None
    scanner: str | None = None
    safety_distance: float | None = None
    penetration_depth: float = 0.0
    bumpers: int = 8
    share: float = LEAST_SHARE
    rule: Rule = Rule.SHARE
    wall_on_left: bool = True
    give_up: GiveUp = GiveUp.HIT_POINT
    pose_source: PoseSource = PoseSource.INS
    speed_limits: SpeedLimits = field(default_factory=SpeedLimits)
    tolerance: float = TOLERANCE
    time_limit: float = math.inf
    timeout: float = 2.0
    drive_unit: DriveUnit = "rad_per_s"


def run_mission(
    client: Client,
    mission: Mission,
    observe: Callable[[NavigationStep], None] = lambda _: None,
) -> Result:
    """Spawn a robot and let it find its way; it stands at the end.

    Args:
        client: A connection without a robot.
        mission: What to do.
        observe: Called at every scan.

    Raises:
        ClientError: If the server does not say what is needed.
        NavigationError: If the robot cannot do what is asked of it.
    """
    start = None if mission.pose is not None else choose_start(client, mission.start)
    client.spawn(mission.robot_class, start=start, pose=mission.pose)
    facts = client.robot_info(drive_unit=mission.drive_unit)
    scanner = facts.scanner(mission.scanner)
    bumpers = Bumpers(
        safety_distance=safety_distance_for(
            facts, mission.safety_distance, mission.penetration_depth
        ),
        count=mission.bumpers,
        share=mission.share,
        rule=mission.rule,
    )
    check_field_of_view(bumpers, scanner)
    settings = BugSettings(
        algorithm=mission.algorithm,
        bumpers=bumpers,
        speed_limits=SpeedLimits(
            min(mission.speed_limits.speed, facts.top_speed), mission.speed_limits.turn
        ),
        wall_on_left=mission.wall_on_left,
        give_up=mission.give_up,
        tolerance=mission.tolerance,
    )
    pilot = Navigator(
        client, facts, scanner, pose_source=mission.pose_source, timeout=mission.timeout
    )
    bug = Bug(mission.goals, settings)
    return pilot.run(bug, bumpers, time_limit=mission.time_limit, observe=observe)


def choose_start(client: Client, wanted: str | None) -> str | None:
    """Find a start among those of the map; some servers tell of none.

    Args:
        client: A connection.
        wanted: Its name; None for the first.

    Returns:
        A name, or None for the server's own choice.

    Raises:
        NavigationError: If the map has others.
    """
    try:
        names = list(client.start_poses())
    except ClientTimeout:
        return wanted
    if wanted is None:
        return names[0] if names else None
    if names and wanted.casefold() not in [name.casefold() for name in names]:
        raise NavigationError(f"start {wanted[:80]!r}, expected one of {names}")
    return wanted


def safety_distance_for(
    facts: RobotInfo, wanted: float | None, penetration_depth: float
) -> float:
    """Give the safety distance of a robot, m.

    Args:
        facts: Of the robot.
        wanted: m; None for what is needed and a margin.
        penetration_depth: How far the sensor sees into foliage, m.

    Raises:
        NavigationError: If the wanted one is too small.
    """
    least = facts.clearance + penetration_depth
    if wanted is None:
        return least + MARGIN
    if wanted < least:
        into = f" and {penetration_depth:.2f} m seen into foliage" * bool(
            penetration_depth
        )
        raise NavigationError(
            f"safety distance {wanted:g} m, expected at least {least:.3f} m,"
            f" half the diagonal of {facts.name}{into}"
        )
    return wanted


def check_field_of_view(bumpers: Bumpers, scanner: ScannerInfo) -> None:
    """Refuse a scanner that does not see all around.

    Raises:
        NavigationError: If some bumpers get none of its beams.
    """
    if blind := bumpers.blind(scanner.angles + scanner.mount.yaw):
        raise NavigationError(
            f"scanner {scanner.name!r} sees {math.degrees(scanner.fov):.0f} degrees, so"
            f" the bumpers {', '.join(blind)} are blind;"
            f" expected a full circle, as {ROBOT} has it"
        )
