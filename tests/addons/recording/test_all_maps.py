"""Runs on all shipped maps are repeated from their recordings, to the byte."""

from pathlib import Path

import pytest
import recorded_runs

from radarsim.addons.recording.bag import BagReader
from radarsim.addons.recording.replay import repeat_run
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.scene.map_file import load_map, shipped_maps
from radarsim.simulation.config import SimulationConfig


@pytest.mark.slow
@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
@pytest.mark.parametrize("name", shipped_maps())
def test_recording_is_repeated(name: str, dialect: Dialect, tmp_path: Path) -> None:
    scene = load_map(name)
    config = SimulationConfig(dialect)
    starts = [start.name for start in scene.starts][:2]
    run = recorded_runs.run_two_clients(
        scene, ticks=60, config=config, starts=(starts[0], starts[-1])
    )
    recorded_runs.write_run(run, tmp_path / "run")
    calls = list(BagReader(tmp_path / "run").calls())
    same = repeat_run(recorded_runs.host_of(run, scene), calls)
    assert not same.difference
    assert same.bytes == sum(map(len, run.sent.values())) > 10_000
