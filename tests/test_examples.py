"""Every example runs, and prints what it says."""

import subprocess
import sys
from pathlib import Path

import numpy as np
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


@pytest.mark.usarsim(map="foliage_room", speed=4)
@pytest.mark.parametrize("name", EXPECTED)
def test_example_runs(name: str, usarsim_server: UsarsimServer) -> None:
    command = [sys.executable, str(EXAMPLES / name), str(usarsim_server.port)]
    printed = subprocess.check_output(command, text=True, timeout=300)
    assert EXPECTED[name] in printed


def run_trials(name: str, *words: str) -> str:
    command = [sys.executable, str(EXAMPLES / "trials" / name), *words]
    return subprocess.check_output(command, text=True, timeout=300)


@pytest.mark.slow
def test_navigators_are_compared_on_random_maps() -> None:
    printed = run_trials("random_maps.py", "1", "planned")
    assert printed == "boxes planned: 2 of 2 right, 0 touches\n"


CYLINDER = """
<model name='cylinder_{0}'><static>1</static><pose>{1} {2} 0.5 0 0 0</pose>
<link name='link'><collision name='collision'><geometry><cylinder><radius>0.075</radius>
<length>1</length></cylinder></geometry></collision></link></model>"""


@pytest.mark.slow
def test_worlds_of_barn_are_scored(tmp_path: Path) -> None:
    places = [(-4.4, 8.0), (-2.25, 8.0), (-0.1, 8.0)]
    models = "".join(CYLINDER.format(i, x, y) for i, (x, y) in enumerate(places))
    text = f"<sdf version='1.6'><world name='default'>{models}</world></sdf>"
    (tmp_path / "world_5.world").write_text(text)
    np.save(tmp_path / "path_5.npy", [[15, column] for column in range(30)])
    printed = run_trials("barn.py", str(tmp_path))
    assert "world 5: reached, 0 touches, score 0.1" in printed
    assert printed.splitlines()[-1].startswith("1 of 1 worlds, score 0.1")
