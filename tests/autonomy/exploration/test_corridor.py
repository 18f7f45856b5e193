"""Corridors that are longer than the scanner sees: straight ones, and a ring."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from radarsim.autonomy.evaluation.mapping_run import MappingRun
from radarsim.autonomy.exploration.exploration import Exploration
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.mapping.trajectory import trajectory_errors
from radarsim.autonomy.plans import ExplorationPlan
from radarsim.client import Client
from radarsim.geometry import Point, Pose2
from radarsim.protocol.reports import Odometry, Report
from radarsim.rng import generator_for
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.host.lockstep import InProcessTransport
from radarsim.simulation.config import SimulationConfig

pytestmark = pytest.mark.slow

CORRIDOR = """\
version: 1
materials:
  concrete: {density: opaque}
objects:
  - {name: floor, box: [60, 20, 0.2], position: [0, 0, -0.1], material: concrete}
  - {name: left, box: [40, 0.2, 2], position: [0, 1.2, 1], material: concrete}
  - {name: right, box: [40, 0.2, 2], position: [0, -1.2, 1], material: concrete}
  - {name: front, box: [0.2, 2.2, 2], position: [20, 0, 1], material: concrete}
  - {name: back, box: [0.2, 2.2, 2], position: [-20, 0, 1], material: concrete}
starts:
  - {name: RobotStart1, position: [-18, 0, 0]}
"""


def test_matching_along_a_corridor_is_no_worse_than_the_motion_alone(
    tmp_path: Path,
) -> None:
    path = tmp_path / "corridor.yaml"
    path.write_text(CORRIDOR)
    config = SimulationConfig(item_settings={"lms200": {"max_range": 6.0}})
    plan = ExplorationPlan(waypoints=((18.0, 0.0),), speed=0.6)
    run = MappingRun(plan, Host(load_map(path), config=config, seed=3))
    run.run()
    errors = run.to_dict()["pose_errors"]
    assert errors["length"] > 30
    assert errors["motion_ate"] > 0.01
    assert errors["ate"] <= 1.1 * errors["motion_ate"] + 0.01


# A corridor 2.2 m wide around a block; 60 m along its middle.
RING = """\
version: 1
materials:
  concrete: {density: opaque}
objects:
  - {name: floor, box: [40, 40, 0.2], position: [0, 0, -0.1], material: concrete}
  - {name: north, box: [18.6, 0.2, 2], position: [0, 8.2, 1], material: concrete}
  - {name: south, box: [18.6, 0.2, 2], position: [0, -8.2, 1], material: concrete}
  - {name: east, box: [0.2, 16.2, 2], position: [9.2, 0, 1], material: concrete}
  - {name: west, box: [0.2, 16.2, 2], position: [-9.2, 0, 1], material: concrete}
  - {name: block, box: [13.8, 11.8, 2], position: [0, 0, 1], material: concrete}
starts:
  - {name: RobotStart1, position: [-3, -7, 0]}
"""
# So near to each other that the way on is shorter than the way back.
AROUND = (
    *((8.0, -7.0), (8.0, 0.0), (8.0, 7.0), (0.0, 7.0), (-8.0, 7.0)),
    *((-8.0, 0.0), (-8.0, -4.0), (-8.0, -7.0), (-3.0, -7.0), (4.0, -7.0)),
)


class UnevenWheels(Client):
    """A client whose robot has a right wheel that is larger than its odometry knows."""

    turn_per_metre = 0.003  # rad
    last: Pose2 | None = None
    drifted = Pose2(0.0, 0.0)

    def read(self, timeout: float | None = None) -> list[Report]:
        """Return the next reports; the odometry drifts."""
        return [
            self._drift(report) if isinstance(report, Odometry) else report
            for report in super().read(timeout)
        ]

    def _drift(self, report: Odometry) -> Odometry:
        step = report.pose.relative_to(self.last or report.pose)
        self.last = report.pose
        turn = step.yaw + self.turn_per_metre * step.x
        self.drifted = self.drifted.compose(Pose2(step.x, step.y, turn))
        return replace(report, pose=self.drifted)


def drive(
    tmp_path: Path, text: str, way: tuple[Point, ...], max_range: float, seed: int
) -> tuple[Mapper, Exploration, Scene]:
    """Drive along a way with odometry that drifts."""
    path = tmp_path / "map.yaml"
    path.write_text(text)
    config = SimulationConfig(item_settings={"lms200": {"max_range": max_range}})
    host = Host(load_map(path), config=config, seed=seed)
    plan = ExplorationPlan(waypoints=way, speed=0.6, motion_source="odometry")
    exploration = Exploration(plan, generator_for(seed, "exploring"))
    with UnevenWheels(InProcessTransport(host)) as client:
        exploration.run(client)
    assert exploration.mapper is not None
    return exploration.mapper, exploration, host.scene


@pytest.mark.parametrize("seed", range(1, 6))
def test_a_ring_closes_with_odometry_that_drifts(tmp_path: Path, seed: int) -> None:
    mapper, exploration, scene = drive(tmp_path, RING, AROUND, 8.0, seed)
    found = trajectory_errors(mapper.trajectory, mapper.truth)
    motion = trajectory_errors(mapper.slam.dead_reckoning, mapper.truth)
    run = MappingRun(exploration.plan, Host(scene))
    run.source = exploration
    run.judge()
    score = run.score
    assert score is not None
    assert motion["ate"] > 0.3
    assert found["ate"] < 0.1
    assert mapper.slam.closures >= 1
    assert score["misplaced"] is not None
    assert score["misplaced"] < 0.005


def niches() -> str:
    """Return the corridor with niches 1 m wide and deep, 4.5 m apart, on both sides."""
    blocks = [
        f"  - {{name: {side}_{k}, box: [3.5, 1, 2],"
        f" position: [{first + 4.5 * k}, {y}, 1], material: concrete}}"
        for side, first, y, count in (("left", -18.25, 1.6, 9), ("right", -16, -1.6, 8))
        for k in range(count)
    ]
    around = CORRIDOR.replace("0, 1.2, 1", "0, 2.2, 1").replace(
        "0, -1.2, 1", "0, -2.2, 1"
    )
    around = around.replace("[0.2, 2.2, 2]", "[0.2, 4.2, 2]")
    head, starts = around.split("starts:")
    return f"{head}{chr(10).join(blocks)}\nstarts:{starts}"


@pytest.mark.parametrize("seed", range(1, 6))
def test_corridors_with_niches_stay_straight_with_odometry_that_drifts(
    tmp_path: Path, seed: int
) -> None:
    mapper, *_ = drive(tmp_path, niches(), ((18.0, 0.0),), 6.0, seed)
    found = trajectory_errors(mapper.trajectory, mapper.truth)
    motion = trajectory_errors(mapper.slam.dead_reckoning, mapper.truth)
    assert found["length"] > 30
    assert motion["yaw"] > math.radians(3)
    assert found["yaw"] < math.radians(0.2)
    assert found["yaw_max"] < math.radians(0.4)


@pytest.mark.parametrize("seed", [1, 2])
def test_niches_in_a_row_are_not_taken_for_one_another(
    tmp_path: Path, seed: int
) -> None:
    way = ((18.0, 0.0), (-18.0, 0.0))
    mapper, *_ = drive(tmp_path, niches(), way, 6.0, seed)
    found = trajectory_errors(mapper.trajectory, mapper.truth)
    motion = trajectory_errors(mapper.slam.dead_reckoning, mapper.truth)
    assert found["length"] > 65
    assert motion["ate"] > 1.0
    assert mapper.slam.closures >= 1
    assert found["ate"] < 0.25  # with wrong closures up to 1.4 m
    assert found["ate_max"] < 0.5
