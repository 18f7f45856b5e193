"""Explorations in lockstep with a simulated server."""

import math
import re
from typing import Any

import numpy as np
import pytest

from radarsim.autonomy.evaluation.navigation_run import GroundTruthMonitor
from radarsim.autonomy.exploration.exploration import (
    Exploration,
    Outcome,
)
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.mapping.occupancy_grid import CellClass
from radarsim.autonomy.mapping.trajectory import trajectory_errors
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.navigation.runner import TripMeter
from radarsim.autonomy.plans import ExplorationPlan, StrategyName
from radarsim.client import Client
from radarsim.errors import ClientError, MappingError, NavigationError
from radarsim.geometry import Pose2
from radarsim.protocol.dialect import UDK
from radarsim.rng import generator_for
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.host.lockstep import InProcessTransport
from radarsim.simulation.config import SimulationConfig

LASER = SimulationConfig(
    item_settings={"lms200": {"sensor": "laser", "fov_deg": 359, "resolution_deg": 1}}
)


def create_exploration(**overrides: Any) -> Exploration:
    values = {"speed": 0.6, **overrides}
    return Exploration(ExplorationPlan(**values), generator_for(0, "exploring"))


def mapper_of(exploration: Exploration) -> Mapper:
    assert exploration.mapper is not None
    return exploration.mapper


def run(
    scene: Scene, config: SimulationConfig | None = None, **overrides: Any
) -> Exploration:
    exploration = create_exploration(**overrides)
    host = Host(scene, config=config)
    monitor = GroundTruthMonitor(host)
    with Client(InProcessTransport(host, after_tick=monitor.watch)) as client:
        exploration.run(client)
    assert monitor.collisions == 0
    assert monitor.path_length == pytest.approx(
        exploration.trip.length, rel=0.05, abs=0.2
    )
    return exploration


def test_room_is_explored(empty_room: Scene) -> None:
    exploration = run(empty_room, strategy=StrategyName.FRONTIERS)
    assert exploration.outcome is Outcome.EXPLORED
    assert exploration.trip.time < 15  # all is seen from the start
    assert exploration.trip.length < 0.2
    assert exploration.safety_distance == pytest.approx(0.5, abs=0.01)


def test_timed_out_exploration_has_the_map_so_far(foliage_room: Scene) -> None:
    activities: list[str] = []
    exploration = create_exploration(time_limit=5.0)
    host = Host(foliage_room)
    with Client(InProcessTransport(host)) as client:
        exploration.run(client, activities.append)
        host.step()
        pose = host.simulation.vehicles[0].robot.pose
        for _ in range(10):
            host.step()
        assert host.simulation.vehicles[0].robot.pose == pose  # it stands
    assert exploration.outcome is Outcome.TIME_LIMIT
    assert mapper_of(exploration).scans == len(activities) == 52
    assert (mapper_of(exploration).grid.classes() == CellClass.FOLIAGE).any()
    assert exploration.trip.time == pytest.approx(5.1)
    assert activities[0] == "looking"
    assert set(activities) == {"looking", "seeking"}


def test_robot_is_commanded_before_the_observer_is_called(empty_room: Scene) -> None:
    """So that an observer that takes long, as a film does, makes no command late."""
    client = Client(InProcessTransport(Host(empty_room)))
    commands: list[tuple[float, float]] = []
    seen: list[int] = []
    drive = client.drive

    def note(left: float, right: float) -> None:
        commands.append((left, right))
        drive(left, right)

    client.drive = note  # type: ignore[method-assign]
    exploration = create_exploration(time_limit=2.0)
    exploration.run(client, lambda _: seen.append(len(commands)))
    assert seen[:3] == [1, 2, 3]
    client.close()


@pytest.mark.slow
@pytest.mark.parametrize("seed", ["odometry", "none"])
def test_every_motion_source_gives_a_map(empty_room: Scene, seed: Any) -> None:
    exploration = run(
        empty_room, motion_source=seed, time_limit=15.0, start="RobotStart2"
    )
    errors = trajectory_errors(
        mapper_of(exploration).trajectory, mapper_of(exploration).truth
    )
    assert errors["ate"] < 0.05
    assert exploration.trip.start is not None
    assert exploration.trip.start.y == pytest.approx(3.5, abs=0.05)


def test_robot_without_odometry_is_reported_with_what_it_has(empty_room: Scene) -> None:
    with pytest.raises(ClientError, match="no pose from odometry within 2 s") as error:
        run(
            empty_room,
            SimulationConfig(UDK),
            motion_source="odometry",
            drive_unit="rev_per_s",
        )
    assert str(error.value).endswith("; set the motion source to ins or none")


def test_laser_maps_no_foliage_and_nothing_behind_it(foliage_room: Scene) -> None:
    exploration = run(foliage_room, LASER, time_limit=3.0, pose=Pose2(-3.0, 0.0, 1.0))
    assert not mapper_of(exploration).grid.sensed(5.0, 0.0)
    assert not (mapper_of(exploration).grid.classes() == CellClass.FOLIAGE).any()


def test_safety_distance_is_larger_without_echoes(foliage_room: Scene) -> None:
    exploration = run(foliage_room, echoes=False, foliage_density=0.7, time_limit=2.0)
    assert exploration.safety_distance == pytest.approx(0.371 + 1.43 + 0.13, abs=0.01)
    assert not (mapper_of(exploration).grid.classes() == CellClass.FOLIAGE).any()


@pytest.mark.slow
def test_robot_that_pushes_against_something_unseen_is_stuck(
    foliage_room: Scene,
) -> None:
    exploration = create_exploration(
        echoes=False, strategy=StrategyName.CONTOUR, pose=Pose2(-2.0, 3.9, 0.0)
    )
    with (
        Client(InProcessTransport(Host(foliage_room))) as client,
        pytest.raises(NavigationError, match="the robot stays at"),
    ):
        exploration.run(client)
    assert exploration.outcome is Outcome.STUCK
    assert mapper_of(exploration).scans > 10


class Rewritten(InProcessTransport):
    """A server some of whose bytes are others after some s."""

    def __init__(self, host: Host, old: bytes, new: bytes, since: float = 2.0) -> None:
        super().__init__(host)
        self._old, self._new, self._since = old, new, since

    def receive(self, timeout: float) -> bytes:
        data = super().receive(timeout)
        is_changed = self.time() >= self._since
        return re.sub(self._old, self._new, data) if is_changed else data


def test_clock_counts_where_time_stamps_stand_still(empty_room: Scene) -> None:
    exploration = create_exploration(time_limit=5.0, echoes=False)
    link = Rewritten(Host(empty_room), rb"{Time [^}]*}", b"{Time 0.0000}", since=0.0)
    with Client(link) as client:
        exploration.run(client)
    assert exploration.outcome is Outcome.TIME_LIMIT
    assert exploration.trip.time == pytest.approx(5.1)
    assert mapper_of(exploration).scans == 52


@pytest.mark.parametrize(
    ("old", "new", "error", "text"),
    [
        pytest.param(
            *(rb"{Name InsTest} {Location [^,]*,", rb"\g<0>-1000", MappingError),
            "the pose of the robot may be wrong",
            id="an INS that is suddenly a kilometre away",
        ),
        pytest.param(
            *(rb"{Range ([^,}]*,){99}[^}]*}", b"{Range 1.0,1.0}", ClientError),
            "scan of 2 ranges from 'lms200', expected",
            id="scans of few beams",
        ),
    ],
)
def test_reports_that_cannot_be_right_are_an_error(
    empty_room: Scene, old: bytes, new: bytes, error: type[Exception], text: str
) -> None:
    exploration = create_exploration(echoes=False)
    with (
        Client(Rewritten(Host(empty_room), old, new)) as client,
        pytest.raises(error, match=text),
    ):
        exploration.run(client)
    assert exploration.outcome is Outcome.FAILED
    assert mapper_of(exploration).scans > 10


@pytest.mark.slow
def test_robot_with_a_forward_scanner_reaches_its_waypoints(
    foliage_room: Scene,
) -> None:
    waypoints = ((-6.0, 2.0), (-3.0, 0.0))
    exploration = run(foliage_room, robot_class="P3AT", waypoints=waypoints)
    assert exploration.outcome is Outcome.EXPLORED
    assert exploration.unreached == ()
    poses = mapper_of(exploration).trajectory.poses
    for place in waypoints:
        assert min(math.dist(place, (pose.x, pose.y)) for pose in poses) < 0.3


@pytest.mark.parametrize(
    ("overrides", "text"),
    [
        pytest.param({"robot_class": "P3AT"}, "sees 180 degrees", id="half blind"),
        pytest.param({"safety_distance": 0.3}, "at least 0.371 m", id="too near"),
        pytest.param({"start": "nowhere"}, "expected one of", id="start"),
    ],
)
def test_impossible_plans_fail_before_the_robot_moves(
    empty_room: Scene, overrides: dict[str, Any], text: str
) -> None:
    exploration = create_exploration(**overrides)
    with (
        Client(InProcessTransport(Host(empty_room))) as client,
        pytest.raises((NavigationError, ClientError), match=text),
    ):
        exploration.run(client)
    assert exploration.outcome is Outcome.FAILED
    assert exploration.trip.start is None


def test_trip_sums_motion_above_noise() -> None:
    trip = TripMeter(noise=0.05)
    assert trip.start is None
    places = [0.0, 0.03, 0.0, 0.04, 0.1, 0.2, 0.19]
    for k, x in enumerate(places):
        trip.add(Observation(1 + 0.1 * k, Pose2(x, 0.0), np.zeros(0), np.zeros(0)))
    assert trip.start == Pose2(0.0, 0.0)
    assert trip.time == pytest.approx(0.6)
    assert trip.length == pytest.approx(0.2)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(StrategyName))
def test_no_strategy_drives_into_foliage(
    foliage_room: Scene, name: StrategyName
) -> None:
    exploration = run(foliage_room, strategy=name, time_limit=100.0)
    assert exploration.outcome in (Outcome.EXPLORED, Outcome.TIME_LIMIT)
    assert max(pose.x for pose in mapper_of(exploration).trajectory.poses) < 0.0
