"""A hedge with two gaps, one into a dead end: who sees it beforehand."""

from pathlib import Path

import pytest
from random_trials import mission_to

from radarsim.autonomy.evaluation.trials import (
    TrialResult,
    config_with_sensor,
    run_plan,
)
from radarsim.scene.map_file import load_map
from radarsim.server.host import Host

HEIGHT = 1.4  # m
# Centre x, y and lengths in m: a hedge across the way with gaps at y = 1 and y = -4.5,
# and a pocket of hedge behind the first, with corners that the hedge itself hides.
HEDGES = (
    *((0.0, 5.5, 0.4, 7.0), (0.0, -1.75, 0.4, 3.5), (0.0, -7.5, 0.4, 4.0)),
    *((4.0, 0.75, 0.4, 6.5), (2.0, 4.0, 4.0, 0.4), (2.0, -2.5, 4.0, 0.4)),
)


def _map(folder: Path) -> Path:
    hedges = "".join(
        f"  - {{name: hedge_{i}, box: [{length}, {width}, {HEIGHT}],"
        f" position: [{x}, {y}, {HEIGHT / 2}], material: leaves}}\n"
        for i, (x, y, length, width) in enumerate(HEDGES)
    )
    path = folder / "dead_end.yaml"
    path.write_text(
        "version: 1\nlevel: DM-DeadEnd\nmaterials:\n  floor: {density: opaque}\n"
        "  leaves: {density: 0.5}\nobjects:\n  - {name: floor, box: [60, 60, 0.2],"
        f" position: [0, 0, -0.1], material: floor}}\n{hedges}"
        "starts:\n  - {name: RobotStart1, position: [-5, 0, 0]}\n"
        "trial: {start: RobotStart1, goal: [7, 0], safety_distance: 0.5}\n"
    )
    return path


def _drive(path: Path, sensor: str) -> TrialResult:
    host = Host(load_map(path), config=config_with_sensor(sensor), seed=0)
    return run_plan(mission_to((7.0, 0.0), "planned", time_limit=600.0), host)


@pytest.mark.slow
def test_radar_knows_of_a_dead_end_of_hedge_before_it_is_there(tmp_path: Path) -> None:
    path = _map(tmp_path)
    radar, laser = (_drive(path, sensor) for sensor in ("radar", "laser"))
    assert radar.outcome == laser.outcome == "reached"
    assert radar.collisions == laser.collisions == 0
    assert radar.path_length < laser.path_length - 2.0
