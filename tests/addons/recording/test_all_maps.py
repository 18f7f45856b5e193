"""Runs on all shipped maps are repeated from their recordings, to the byte."""

from pathlib import Path

import pytest
import recorded_runs

from radarsim.addons.recording.bag import BagReader
from radarsim.addons.recording.host_recorder import EventType
from radarsim.addons.recording.replay import repeat_run
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.scene.map_file import load_map, shipped_maps
from radarsim.simulation.config import SimulationConfig


@pytest.mark.slow
@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
@pytest.mark.parametrize("name", shipped_maps())
def test_recording_is_repeated_and_a_changed_byte_is_found(
    name: str, dialect: Dialect, tmp_path: Path
) -> None:
    scene = load_map(name)
    config = SimulationConfig(dialect)
    starts = [start.name for start in scene.starts][:2]
    run = recorded_runs.run_two_clients(
        scene, ticks=60, config=config, starts=(starts[0], starts[-1])
    )
    recorded_runs.write_run(run, tmp_path / "run")
    calls = list(BagReader(tmp_path / "run").calls())
    same = repeat_run(recorded_runs.host_of(run, scene), calls)
    assert same.difference is None
    assert same.bytes == sum(map(len, run.sent.values())) > 10_000
    changed = [
        call._replace(data=call.data.replace(b"{Left 3}", b"{Left 0}"))
        if call.type is EventType.RECEIVE
        else call
        for call in calls
    ]
    (drove,) = (call.tick for call in changed if b"{Left 0}" in call.data)
    found = repeat_run(recorded_runs.host_of(run, scene), changed).difference
    assert found is not None
    assert drove < found.tick <= drove + 20
    lines = run.sent[1].decode("latin-1").split("\r\n")
    assert found.recorded in lines[found.line - 1]
