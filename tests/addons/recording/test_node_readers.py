"""The readers of @mcap/core, which Foxglove uses, under node."""

import json
import subprocess
from collections import Counter
from pathlib import Path

import pytest
import recorded_runs
from node_packages import install_packages

from radarsim.addons.recording.bag import BagReader
from radarsim.addons.recording.bag_folder import file_name
from radarsim.scene.scene import Scene

PROGRAM = Path(__file__).with_name("read_mcap.mjs")
PACKAGES = ("@mcap/core@2.2.2", "@foxglove/wasm-zstd@1.0.1")


@pytest.mark.slow
def test_both_readers_find_all_messages(foliage_room: Scene, tmp_path: Path) -> None:
    packages, folder = tmp_path / "node", tmp_path / "run"
    packages.mkdir()
    install_packages(packages, *PACKAGES)
    recorded_runs.write_run(recorded_runs.run_two_clients(foliage_room), folder)
    path = folder / file_name(folder)
    command = ["node", str(PROGRAM), str(packages), str(path)]
    found = json.loads(subprocess.check_output(command, timeout=240))
    expected = Counter(message.topic for message in BagReader(folder).messages())
    assert found == {"indexed": expected, "stream": expected}
    # A changed byte is noticed.
    content = bytearray(path.read_bytes())
    content[len(content) // 3] ^= 1
    path.write_bytes(content)
    with pytest.raises(subprocess.CalledProcessError):
        subprocess.run(command, capture_output=True, timeout=240, check=True)
