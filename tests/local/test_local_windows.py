"""Windows follow a run until they are closed; notebooks show pictures instead."""

import base64
import re
from typing import Any

import pytest
from windows import run_with

from radarsim.local import simulate

FOLLOW = """
import io
import numpy as np
import radarsim

def difference():
    picture = Image.open(io.BytesIO(sim._repr_png_())).convert("RGB")
    shown = grab(*picture.size).convert("RGB")
    return np.abs(np.asarray(shown, float) - np.asarray(picture)).mean()

sim = radarsim.simulate("foliage_room")
sim.show()
robot = sim.spawn()
robot.drive(0.5)
sim.step(1.0)
first = grab(1050, 720)
for _ in range(9):
    sim.step(0.01)
print(grab(1050, 720) == first)  # not drawn more often than each 0.1 s
sim.step(0.01)
print(difference() < 0.05, grab(1050, 720) == first)
sim.spawn("P3AT_SICK")  # the title, the legend and names change
sim.step(1.0)
sim.show()
print(difference() < 0.05, pyplot.get_fignums())
close(1)
sim.step(1.0)
sim.step(1.0)
print(pyplot.get_fignums())
sim.show()
print(difference() < 0.05, pyplot.get_fignums())
"""
SHOW = "import radarsim; radarsim.simulate('empty_room').show()"
CELL = """
import radarsim
sim = radarsim.simulate("foliage_room")
sim.spawn().drive(0.5)
sim.show()
for _ in range(3):
    sim.step(0.1)
"""


def test_window_shows_the_picture_of_each_step_until_it_is_closed(
    display: dict[str, str],
) -> None:
    assert run_with(display, FOLLOW) == [
        *("True", "True False", "True [1]", "[]", "True [1]"),
    ]


@pytest.mark.parametrize("variables", [{}, {"MPLBACKEND": "tkagg"}])
def test_error_says_what_to_do_without_a_display(variables: dict[str, str]) -> None:
    (line,) = run_with(variables, SHOW)
    assert re.fullmatch(
        r"radarsim.errors.RadarsimError: matplotlib's backend '\w+' opens no window"
        " here, expected a display and a toolkit such as tkinter; without a window use"
        r' sim.render\("run.png"\)',
        line,
    )


def test_picture_in_a_notebook_follows(monkeypatch: pytest.MonkeyPatch) -> None:
    import nbformat
    from nbclient import NotebookClient

    # Commands that ran in this process have set it, and the kernel would inherit it.
    monkeypatch.delenv("MPLBACKEND", raising=False)
    new: Any = nbformat.v4
    notebook = new.new_notebook(cells=[new.new_code_cell(CELL)])
    NotebookClient(notebook, timeout=600).execute()
    (output,) = notebook.cells[0].outputs
    sim = simulate("foliage_room")
    sim.spawn().drive(0.5)
    sim.step(0.3)
    assert base64.b64decode(output["data"]["image/png"]) == sim._repr_png_()
