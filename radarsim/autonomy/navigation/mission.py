"""Missions: spawn a robot, query its properties, and drive it to its goals."""

import math
from collections.abc import Callable, Sequence

from radarsim.autonomy.navigation.bug import Bug
from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.control import SpeedLimits
from radarsim.autonomy.navigation.controller import (
    Controller,
    ControllerSettings,
    Point,
)
from radarsim.autonomy.navigation.options import ROBOT, Algorithm
from radarsim.autonomy.navigation.path_planning import PathPlanning
from radarsim.autonomy.navigation.plans import Mission
from radarsim.autonomy.navigation.runner import (
    NavigationStep,
    Navigator,
    Result,
)
from radarsim.autonomy.navigation.tangent_bug import TangentBug
from radarsim.client import Client, RobotInfo, ScannerInfo
from radarsim.errors import ClientTimeout, NavigationError, expected_one_of

MARGIN = 0.13  # m added to the least safety distance, for noise and braking


def run_mission(
    client: Client,
    mission: Mission,
    observe: Callable[[NavigationStep], None] = lambda _: None,
) -> Result:
    """Spawn a robot and drive it to its goals; it stands at the end.

    Args:
        client: A connection without a robot.
        mission: The mission.
        observe: Called at every scan.

    Raises:
        ClientError: If the server does not send what is needed.
        NavigationError: If the robot cannot do what the mission asks for.
    """
    start = None if mission.pose is not None else choose_start(client, mission.start)
    client.spawn(mission.robot_class, start=start, pose=mission.pose)
    robot_info = client.robot_info(drive_unit=mission.drive_unit)
    scanner = robot_info.scanner(mission.scanner)
    bumpers = Bumpers(
        safety_distance=safety_distance_for(
            robot_info, mission.safety_distance, mission.penetration_depth
        ),
        count=mission.bumpers,
        share=mission.share,
        rule=mission.rule,
    )
    check_field_of_view(bumpers, scanner)
    settings = ControllerSettings(
        algorithm=mission.algorithm,
        bumpers=bumpers,
        speed_limits=SpeedLimits(
            min(mission.speed, robot_info.top_speed), mission.turn_speed
        ),
        wall_on_left=mission.side == "left",
        give_up=mission.give_up,
        tolerance=mission.tolerance,
    )
    navigator = Navigator(
        client,
        robot_info,
        scanner,
        pose_source=mission.pose_source,
        timeout=mission.timeout,
        echoes=mission.echoes,
    )
    return navigator.run(
        create_controller(mission.goals, settings),
        bumpers,
        time_limit=mission.time_limit,
        observe=observe,
    )


def create_controller(
    goals: Sequence[Point], settings: ControllerSettings
) -> Controller:
    """Create what decides how to move, by the algorithm of the settings."""
    match settings.algorithm:
        case Algorithm.PLANNED:
            return PathPlanning(goals, settings)
        case Algorithm.TANGENT_BUG:
            return TangentBug(goals, settings)
        case Algorithm.BUG1 | Algorithm.BUG2:
            return Bug(goals, settings)


def choose_start(client: Client, wanted: str | None) -> str | None:
    """Choose a start pose of the map; some servers announce none.

    Args:
        client: A connection.
        wanted: Name of the start pose; None for the first.

    Returns:
        A name, or None to leave the choice to the server.

    Raises:
        NavigationError: If the map has start poses, but not that one.
    """
    try:
        names = list(client.start_poses())
    except ClientTimeout:
        return wanted
    if wanted is None:
        return names[0] if names else None
    if names and wanted.casefold() not in [name.casefold() for name in names]:
        raise NavigationError(f"start {expected_one_of(wanted, names)}")
    return wanted


def safety_distance_for(
    robot_info: RobotInfo, wanted: float | None, penetration_depth: float
) -> float:
    """Return the safety distance of a robot, m.

    Args:
        robot_info: Properties of the robot.
        wanted: m; None for the least one that is safe, and a margin.
        penetration_depth: How far the sensor sees into foliage, m.

    Raises:
        NavigationError: If the wanted one is too small.
    """
    least = robot_info.clearance + penetration_depth
    if wanted is None:
        return least + MARGIN
    if wanted < least:
        foliage = f" and {penetration_depth:.2f} m seen into foliage"
        foliage *= penetration_depth > 0
        raise NavigationError(
            f"safety distance {wanted:g} m, expected at least {least:.3f} m,"
            f" half the diagonal of {robot_info.name}{foliage}"
        )
    return wanted


def check_field_of_view(bumpers: Bumpers, scanner: ScannerInfo) -> None:
    """Refuse a scanner that does not cover a full circle.

    Raises:
        NavigationError: If some bumpers get none of its beams.
    """
    if blind := bumpers.blind(scanner.angles + scanner.mount.yaw):
        raise NavigationError(
            f"scanner {scanner.name!r} sees {math.degrees(scanner.fov):.0f} degrees, so"
            f" the bumpers {', '.join(blind)} are blind;"
            f" expected a full circle, as {ROBOT} has it"
        )
