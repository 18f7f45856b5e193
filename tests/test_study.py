"""The scripts of the study run, and write rows, a table and a figure."""

import json
import math
import subprocess
import sys
from pathlib import Path

import pytest

STUDY = Path(__file__).parents[1] / "examples" / "study"


def run(name: str, *words: str) -> str:
    command = [sys.executable, str(STUDY / name), *words]
    return subprocess.check_output(command, text=True, timeout=300)


@pytest.mark.slow
def test_laser_takes_smoke_for_a_wall(tmp_path: Path) -> None:
    only = "smoke_corridor:first-echo laser"
    printed = run("run.py", "--seeds", "1", "--only", only)
    row = json.loads(printed)
    assert (row["expected"], row["outcome"]) == ("reached", "no_path")
    assert math.isclose(row["shortest_path"], 12.0, abs_tol=0.1)
    rows, picture = tmp_path / "rows.jsonl", tmp_path / "study.png"
    rows.write_text(printed)
    table = run("figure.py", str(rows), str(picture)).splitlines()
    assert table[-1].startswith("| smoke_corridor | first-echo laser | 0.000 |")
    assert picture.read_bytes().startswith(b"\x89PNG")
