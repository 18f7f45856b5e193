"""Missions: spawn a robot, query its properties, and drive it to its goals."""

import math
from collections.abc import Callable
from typing import Final

from radarsim.autonomy.navigation.bug import Bug
from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.control import SpeedLimits
from radarsim.autonomy.navigation.controller import Controller, ControllerSettings
from radarsim.autonomy.navigation.footprint_planning import Footprint
from radarsim.autonomy.navigation.observation import ECHO_WAIT, ObservationBuilder
from radarsim.autonomy.navigation.path_planning import PathPlanning
from radarsim.autonomy.navigation.runner import NavigationStep, Navigator, Result
from radarsim.autonomy.navigation.tangent_bug import TangentBug
from radarsim.autonomy.plans import ROBOT, Algorithm, DrivePlan, Mission
from radarsim.client import Client, RobotInfo, ScannerInfo
from radarsim.errors import NavigationError

CONTROLLERS: Final[dict[Algorithm, type[Controller]]] = {
    Algorithm.BUG1: Bug,
    Algorithm.BUG2: Bug,
    Algorithm.TANGENT_BUG: TangentBug,
    Algorithm.PLANNED: PathPlanning,
}
MARGIN = 0.13  # m added to the smallest safety distance, for noise and braking


def spawn_robot(
    client: Client, plan: DrivePlan, info: RobotInfo | None = None
) -> tuple[RobotInfo, ScannerInfo, float, SpeedLimits]:
    """Spawn the robot of a plan, and query its properties.

    Args:
        client: The connection.
        plan: The plan.
        info: Properties of an existing robot; None to spawn one.

    Returns:
        The properties of the robot, its scanner, the safety distance, m, and the speed
        limits of the plan, capped at the speed of the robot.

    Raises:
        ClientError: If the server does not send the properties.
        NavigationError: If the robot cannot carry out the plan.
    """
    if info is None:
        client.spawn(plan.robot_class, start=plan.start, pose=plan.pose)
        info = client.robot_info(drive_unit=plan.drive_unit)
    return (
        info,
        info.scanner(plan.scanner),
        safety_distance_for(info, plan.safety_distance, plan.penetration_depth),
        SpeedLimits(min(plan.speed, info.top_speed), plan.turn_speed),
    )


def run_mission(
    client: Client,
    mission: Mission,
    observe: Callable[[NavigationStep], None] = lambda _: None,
    *,
    info: RobotInfo | None = None,
) -> Result:
    """Spawn a robot, drive it to its goals, and stop it there.

    Args:
        client: A connection without a robot, unless ``info`` is given.
        mission: The mission.
        observe: Called at every scan.
        info: Properties of an existing robot, such as one from
            ``LocalRobot.as_client``; None to spawn the robot of the mission.

    Raises:
        ClientError: If the server does not send the required reports.
        NavigationError: If the robot cannot carry out the mission.
    """
    info, scanner, safety_distance, speed_limits = spawn_robot(client, mission, info)
    bumpers = Bumpers(
        safety_distance=safety_distance,
        count=mission.bumpers,
        share=mission.share,
        rule=mission.rule,
    )
    # This is checked before the robot drives: where
    # a bumper has no beams, it would hit obstacles.
    check_field_of_view(bumpers, scanner)
    footprint = footprint_for(info, mission)
    settings = ControllerSettings(mission, bumpers, speed_limits, footprint)
    controller = CONTROLLERS[mission.algorithm](settings)
    if mission.echoes:
        client.echoes(scanner.name)
    echo_wait, clock = ECHO_WAIT * mission.echoes, client.transport.time
    source = ObservationBuilder(
        scanner, mission.pose_source, clock, echo_wait=echo_wait
    )
    navigator = Navigator(client, info, source, controller, bumpers)
    return navigator.run(mission, observe)


def safety_distance_for(
    robot_info: RobotInfo, wanted: float | None, penetration_depth: float
) -> float:
    """Return the distance, m, that a robot's centre has to keep from obstacles.

    Args:
        robot_info: Properties of the robot.
        wanted: Requested safety distance, m; None for the smallest safe one plus a
            margin.
        penetration_depth: Depth to which the sensor sees into foliage, m.

    Raises:
        NavigationError: If the requested safety distance is too small.
    """
    least = robot_info.clearance + penetration_depth
    if wanted is None:
        return least + MARGIN
    if wanted < least:
        foliage = f" plus the view of {penetration_depth:.2f} m into foliage"
        foliage *= penetration_depth > 0
        raise NavigationError(
            f"safety distance {wanted:g} m, expected at least {least:.3f} m,"
            f" half the diagonal of {robot_info.name}{foliage}"
        )
    return wanted


def footprint_for(robot_info: RobotInfo, mission: Mission) -> Footprint | None:
    """Return the robot's footprint, enlarged by the error of ranges at obstacles.

    None if beams may end at an unknown depth behind the front of an obstacle.
    """
    if not mission.echoes and mission.foliage_density is None:
        return None
    more = 2 * mission.penetration_depth
    return Footprint(robot_info.length + more, robot_info.width + more)


def check_field_of_view(bumpers: Bumpers, scanner: ScannerInfo) -> None:
    """Raise an error if the beams of a scanner do not cover a full circle.

    Raises:
        NavigationError: If a bumper has no beams.
    """
    if blind := bumpers.blind(scanner.angles + scanner.mount.yaw):
        raise NavigationError(
            f"scanner {scanner.name!r} sees {math.degrees(scanner.fov):.0f} degrees, so"
            f" the bumpers {', '.join(blind)} have no beams;"
            f" expected a full circle, as on a {ROBOT}"
        )
