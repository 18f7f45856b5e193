"""Every example runs, and prints what it says."""

import subprocess
import sys
from pathlib import Path

import pytest

from radarsim.addons.testing import UsarsimServer

EXAMPLES = Path(__file__).parents[1] / "examples"
EXPECTED = {
    "follow_walls.py": "m off, 0 touches",
    "plain_socket.py": "181 ranges, the nearest",
    "see_through_bushes.py": "laser: 0 of 181",
    "stop_before_obstacles.py": "stopped at x",
}


def test_every_example_is_run() -> None:
    assert {path.name for path in EXAMPLES.glob("*.py")} == EXPECTED.keys()


@pytest.mark.usarsim(map="foliage_room")
@pytest.mark.parametrize("name", EXPECTED)
def test_example_runs(name: str, usarsim_server: UsarsimServer) -> None:
    command = [sys.executable, str(EXAMPLES / name), str(usarsim_server.port)]
    printed = subprocess.check_output(command, text=True, timeout=300)
    assert EXPECTED[name] in printed
