"""Another robot crosses a navigator's path, or meets it, and looks nowhere."""

import itertools
import math

import pytest
from random_trials import load_random_map, mission_to

from radarsim.autonomy.evaluation.navigation_run import GroundTruthMonitor
from radarsim.autonomy.navigation.mission import run_mission
from radarsim.autonomy.navigation.runner import NavigationStep, Result
from radarsim.client import Client
from radarsim.generators.random_maps import RandomMap
from radarsim.geometry import Pose2
from radarsim.server.host import Host
from radarsim.server.host.lockstep import InProcessTransport

MEETING: float = 18.2  # s after which a navigator is where the paths cross


def drive_past(
    algorithm: str, pose: Pose2, speed: float, *, time_limit: float
) -> Result:
    """Drive to a goal while another robot drives straight on from a pose."""
    start, goal = (-5.0, 0.0), (3.0, 0.0)
    host = Host(load_random_map(RandomMap(0, "boxes", (), math.inf, start, goal)))
    monitor = GroundTruthMonitor(host)
    with (
        Client(InProcessTransport(host)) as other,
        Client(InProcessTransport(host, after_tick=monitor.watch)) as client,
    ):
        other.spawn("P3AT", pose=pose)
        wheels = other.robot_info().wheel_speeds(speed, 0.0)
        steps = itertools.count()

        def start_other(_: NavigationStep) -> None:
            if next(steps) == 0:
                other.drive(*wheels)

        mission = mission_to(goal, algorithm, time_limit=time_limit)
        result = run_mission(client, mission, start_other)
    assert result.outcome == "reached"
    assert monitor.collisions == 0
    return result


@pytest.mark.slow
@pytest.mark.parametrize(
    ("algorithm", "speed", "delay"),
    [
        pytest.param("bug1", 0.4, -1.0, id="crosses before"),
        pytest.param("bug2", 0.5, 0.0, id="meets"),
        pytest.param("bug1", 0.5, 1.5, id="stood in its way"),
        pytest.param("tangentbug", 0.4, 1.9, id="stood at the edge of its way"),
        pytest.param("planned", 0.5, 2.1, id="stood on the way of planned paths"),
        pytest.param("tangentbug", 0.5, 2.8, id="drove on into its way"),
        pytest.param("bug2", 0.3, 4.2, id="slow, drove on into its way"),
    ],
)
@pytest.mark.parametrize("side", [-1, 1])
def test_crossing_robot_is_let_by_and_not_touched(
    algorithm: str, speed: float, delay: float, side: int
) -> None:
    away = speed * (MEETING + delay)
    pose = Pose2(0.0, -side * away, side * math.pi / 2)
    drive_past(algorithm, pose, speed, time_limit=120.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("speed", "aside", "begin"),
    [
        pytest.param(0.2, 0.1, 6.0, id="slow"),
        pytest.param(0.3, 0.0, 6.0, id="as fast"),
        pytest.param(0.3, 0.3, 7.0, id="on the left"),
        pytest.param(0.3, -0.3, 8.0, id="on the right, over the goal"),
        pytest.param(0.5, 0.0, 7.0, id="faster"),
        pytest.param(0.5, -0.1, 6.0, id="faster, a little to the side"),
    ],
)
def test_planned_path_leads_round_a_robot_that_comes_the_other_way(
    speed: float, aside: float, begin: float
) -> None:
    """To stand, or to back off before it, would never end: it drives on and on."""
    pose = Pose2(begin, aside, math.pi)
    result = drive_past("planned", pose, speed, time_limit=60.0)
    # without the other robot it takes 26.7 s and 7.9 m
    assert result.time < 40
    assert result.path_length < 9.5
