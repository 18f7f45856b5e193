import math
from typing import Any

import pytest

from radarsim.autonomy.navigation.mission import MARGIN, footprint_for, run_mission
from radarsim.autonomy.navigation.runner import NavigationStep, Result
from radarsim.autonomy.plans import Algorithm, Mission
from radarsim.client import Client
from radarsim.errors import ClientError, NavigationError
from radarsim.geometry import Pose2
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.scene.shapes import box
from radarsim.server.host import Host
from radarsim.server.host.lockstep import InProcessTransport
from radarsim.simulation.config import SimulationConfig

HALF_DIAGONAL = 0.371  # m, of a P3AT


class NoStartPoses(InProcessTransport):
    """A link to a server that announces no start poses."""

    def receive(self, timeout: float) -> bytes:
        while b"StartPoses" in (data := super().receive(timeout)):
            pass
        return data


def mission(**overrides: Any) -> Mission:
    values = {"algorithm": Algorithm.BUG1, "goals": ((-7.0, 0.0),), **overrides}
    return Mission(**values)


def first_pose(link: InProcessTransport, **overrides: Any) -> Pose2:
    """Return the true pose of the robot at its start."""
    poses: list[Pose2] = []

    def look(_: NavigationStep) -> None:
        poses.append(link.host.simulation.vehicles[0].robot.pose)

    with Client(link) as client:
        run_mission(client, mission(time_limit=0.1, **overrides), look)
    return poses[0]


def run(
    scene: Scene, config: SimulationConfig | None = None, **overrides: Any
) -> Result:
    with Client(InProcessTransport(Host(scene, config=config))) as client:
        return run_mission(client, mission(**overrides))


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        pytest.param({}, Pose2(-8.0, 0.0), id="the server's first"),
        pytest.param({"start": "RobotStart2"}, Pose2(-8.0, 3.5), id="a name"),
        pytest.param({"start": "robotstart2"}, Pose2(-8.0, 3.5), id="in any case"),
        pytest.param({"pose": Pose2(-3.0, 1.0, 0.5)}, Pose2(-3.0, 1.0, 0.5), id="pose"),
    ],
)
def test_start_pose_of_a_mission(
    foliage_room: Scene, overrides: dict[str, Any], expected: Pose2
) -> None:
    pose = first_pose(
        InProcessTransport(Host(foliage_room)), safety_distance=0.5, **overrides
    )
    assert (pose.x, pose.y) == pytest.approx((expected.x, expected.y), abs=0.05)
    assert math.remainder(pose.yaw - expected.yaw, 2 * math.pi) == pytest.approx(
        0, abs=0.05
    )


def test_goal_outside_the_box_around_all_objects_is_driven_to() -> None:
    scene = Scene("open", "DM-Open", (Part("pole", Material("metal"), *box(1, 1, 2)),))
    goals = ((-1.5, 2.0),)
    assert run(scene, pose=Pose2(-2.5, 2.0), goals=goals).outcome == "reached"


def test_start_is_not_checked_if_the_server_announces_none(foliage_room: Scene) -> None:
    pose = first_pose(NoStartPoses(Host(foliage_room)), start="RobotStart2")
    assert (pose.x, pose.y) == pytest.approx((-8.0, 3.5), abs=0.05)


@pytest.mark.parametrize(
    ("overrides", "error", "text"),
    [
        ({"start": "Nowhere"}, ClientError, "start 'Nowhere', expected one of"),
        (
            {"robot_class": "Submarine"},
            ClientError,
            "no reading of the robot 'Submarine': robot class 'Submarine', expected",
        ),
        (
            {"robot_class": "P3AT"},
            NavigationError,
            "sees 180 degrees, so the bumpers back_left, back, back_right have no beam",
        ),
        ({"safety_distance": 0.36}, NavigationError, r"expected at least 0\.371 m"),
        (
            {"safety_distance": 1.3, "foliage_density": 1.0},
            NavigationError,
            r"1\.371 m, .* the view of 1\.00 m into foliage",
        ),
    ],
)
def test_mission_that_a_robot_cannot_drive_is_an_error(
    empty_room: Scene, overrides: dict[str, Any], error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        run(empty_room, **overrides)


@pytest.mark.parametrize("penetration_depth", [0.0, 0.8])
def test_default_safety_distance_is_hull_foliage_and_margin(
    empty_room: Scene, penetration_depth: float
) -> None:
    density = 1 / penetration_depth if penetration_depth else None
    result = run(empty_room, foliage_density=density, time_limit=0.1)
    expected = HALF_DIAGONAL + penetration_depth + MARGIN
    assert result.safety_distance == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("unit", ["rad_per_s", "rev_per_s"])
def test_wheel_speeds_are_in_the_unit_of_the_server(
    empty_room: Scene, unit: Any
) -> None:
    result = run(empty_room, SimulationConfig(drive_unit=unit), drive_unit=unit)
    assert result.outcome == "reached"
    assert result.time == pytest.approx(0.9 / 0.3, abs=0.7)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("side", "sign"), [pytest.param("left", -1), pytest.param("right", 1)]
)
def test_robot_turns_the_boundary_to_the_chosen_side(
    foliage_room: Scene, side: str, sign: int
) -> None:
    turns: list[float] = []
    plan = mission(
        goals=((8.0, 0.0),),
        start="RobotStart1",
        safety_distance=2.0,
        side=side,
        time_limit=30.0,
    )
    with Client(InProcessTransport(Host(foliage_room))) as client:
        run_mission(client, plan, lambda moment: turns.append(moment.twist.turn))
    assert max(turns, key=abs) * sign == pytest.approx(plan.turn_speed)


@pytest.mark.parametrize(
    ("overrides", "footprint"),
    [
        pytest.param({}, (0.552, 0.497), id="echoes"),
        pytest.param({"echoes": False}, None, id="no echoes"),
        pytest.param(
            {"echoes": False, "foliage_density": 4.0},
            (1.052, 0.997),
            id="depth to which the radar sees into foliage",
        ),
    ],
)
def test_footprint_is_as_large_as_what_is_not_seen_asks_for(
    foliage_room: Scene,
    overrides: dict[str, Any],
    footprint: tuple[float, float] | None,
) -> None:
    with Client(InProcessTransport(Host(foliage_room))) as client:
        client.spawn("P3AT_Radar360")
        found = footprint_for(client.robot_info(), mission(**overrides))
    size = None if found is None else (found.length, found.width)
    assert size == (footprint if footprint is None else pytest.approx(footprint))
