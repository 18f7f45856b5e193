"""A corridor without features, longer than the scanner sees."""

from pathlib import Path

import pytest

from radarsim.evaluation.mapping_run import MappingRun
from radarsim.exploration.exploration import ExplorationPlan
from radarsim.host import Host
from radarsim.navigation.control import SpeedLimits
from radarsim.scene.map_file import load_map
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
    plan = ExplorationPlan(
        waypoints=((18.0, 0.0),), speed_limits=SpeedLimits(speed=0.6)
    )
    run = MappingRun(plan, Host(load_map(path), config=config, seed=3))
    run.run(("", 0))
    errors = run.result.to_dict()["pose_errors"]
    assert errors["length"] > 30
    assert errors["motion_ate"] > 0.01
    assert errors["ate"] <= 1.1 * errors["motion_ate"] + 0.01
