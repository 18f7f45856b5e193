"""The notebook of the manual runs, cell by cell, and shows what it shows now."""

import ast
import json

import matplotlib.pyplot as plt
import pytest
from documents import MANUAL

NOTEBOOK = MANUAL / "radar_in_ten_minutes.ipynb"


@pytest.mark.slow
def test_notebook_runs_and_its_texts_are_what_it_shows() -> None:
    namespace: dict[str, object] = {}
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    shown = 0
    for cell in cells:
        if cell["cell_type"] != "code":
            continue
        tree = ast.parse("".join(cell["source"]))
        last = tree.body.pop()
        assert isinstance(last, ast.Expr)
        exec(compile(tree, "cell", "exec"), namespace)
        value = eval(compile(ast.Expression(last.value), "cell", "eval"), namespace)
        (output,) = cell["outputs"]
        if "image/png" not in output["data"]:
            assert repr(value) == "".join(output["data"]["text/plain"])
            shown += 1
    plt.close("all")
    assert shown == 5
