import json
import re
import shlex
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import start_radarsim

from radarsim.autonomy.mapping.export import commander_png
from radarsim.autonomy.navigation.algorithms import Algorithm
from radarsim.files import PICTURE_MARK
from radarsim.lab.figures import dust as readings
from radarsim.lab.figures import foliage_wall as foliage
from radarsim.lab.figures import rays, runs
from radarsim.lab.figures.catalogue import FIGURES, NUMBERS
from radarsim.lab.figures.figure import ScanSpec
from radarsim.lab.figures.page import split_page

Command = Callable[..., Any]
SHOTS = {
    "7": foliage.hokuyo(5),
    "8": foliage.radar(5, 0),
    "10": foliage.radar(5, 100),
    "3": readings.scan_spec_for(readings.RADAR, "dust", 5),
    "5b": rays.scatter_spec(5),
    "11": rays.offset_spec(5, 50, 1),
}


def figures_on(page: Path) -> list[str]:
    return re.findall(r'<figure id="figure-([\w-]+)">', page.read_text())


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_chosen_figures_are_written_with_a_page(
    radarsim: Command, tmp_path: Path
) -> None:
    out = tmp_path / "a" / "b"
    run = radarsim("figures", str(out), "--only", "06,5B")
    assert run.code == 0
    assert run.text == f"{out / 'index.html'}\n"
    assert sorted(contents(out)) == ["figure_05b.png", "figure_06.png", "index.html"]
    assert figures_on(out / "index.html") == ["5b", "6"]
    assert all(
        PICTURE_MARK in (out / f"figure_{n}.png").read_bytes() for n in ("05b", "06")
    )


@pytest.mark.slow
def test_new_figures_are_added_to_a_folder_and_other_files_stay(
    radarsim: Command, tmp_path: Path
) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    radarsim("figures", str(tmp_path), "--only", "6,7")
    before = contents(tmp_path)
    assert radarsim("figures", str(tmp_path), "--only", "11").code == 0
    after = contents(tmp_path)
    assert figures_on(tmp_path / "index.html") == ["6", "7", "11"]
    same = set(before) - {"index.html"}
    assert {name: after[name] for name in same} == {n: before[n] for n in same}
    (tmp_path / "figure_07.png").unlink()
    radarsim("figures", str(tmp_path), "--only", "6")
    assert figures_on(tmp_path / "index.html") == ["6", "11"]
    assert contents(tmp_path)["figure_06.png"] == before["figure_06.png"]


@pytest.mark.parametrize("name", ["index.html", "figure_06.png"])
def test_files_of_other_programs_are_not_overwritten(
    radarsim: Command, tmp_path: Path, name: str
) -> None:
    (tmp_path / name).write_text("<p>not by this program</p>")
    before = contents(tmp_path)
    run = radarsim("figures", str(tmp_path), "--only", "6")
    assert run.code == 2
    assert "is not by radarsim" in run.err
    assert contents(tmp_path) == before


@pytest.mark.parametrize("only", ["16", "", "7,x", "7,,8"])
def test_unknown_numbers_are_a_usage_error(
    radarsim: Command, tmp_path: Path, only: str
) -> None:
    run = radarsim("figures", str(tmp_path / "out"), "--only", only)
    assert run.code == 2
    assert "expected some of" in run.err
    assert not (tmp_path / "out").exists()


def test_file_in_place_of_the_folder_is_a_usage_error(
    radarsim: Command, tmp_path: Path
) -> None:
    (tmp_path / "out").write_text("")
    run = radarsim("figures", str(tmp_path / "out"), "--only", "6")
    assert run.code == 2
    assert "cannot write" in run.err


@pytest.mark.parametrize("number", SHOTS)
def test_commands_in_captions_repeat_the_scans(radarsim: Command, number: str) -> None:
    shot: ScanSpec = SHOTS[number]
    told = json.loads(radarsim(*shlex.split(shot.command)[1:]).text)
    scans = [told] if shot.count == 1 else told
    for scan, one in zip(shot.take(), scans, strict=True):
        ranges = [np.inf if r is None else r for r in one["ranges"]]
        assert scan.ranges.tolist() == ranges


@pytest.mark.slow
def test_commands_in_captions_repeat_the_runs(radarsim: Command) -> None:
    run = runs.run(runs.CLOSED, Algorithm.BUG2, 1)
    words = f"navigate --serve {runs.CLOSED} --algorithm bug2 --seed 1 --json"
    told = json.loads(radarsim(*words.split()).text)
    assert told["path_length"] == pytest.approx(run.run_log.path_length, abs=1e-3)
    assert run.monitor is not None
    off = run.monitor.distance(run.mission.goals[-1])
    assert told["judge"]["goal_distance"] == pytest.approx(off, abs=1e-3)


@pytest.mark.slow
def test_commands_in_captions_repeat_the_maps(
    radarsim: Command, tmp_path: Path
) -> None:
    drive = runs.hokuyo(1, ((-6.0, 0.0), (-6.0, -1.0)))
    run = drive.explore()
    words = shlex.split(drive.command.replace(" OUT ", f" {tmp_path}/map "))
    told = json.loads(radarsim(*words[1:], "--json").text)
    assert told["judge"]["path_length"] == pytest.approx(run.length, abs=1e-3)
    assert told["judge"]["right"] == run.score.right
    assert (tmp_path / "map.png").read_bytes() == commander_png(run.grid)


@pytest.mark.slow
def test_all_figures_are_on_one_page(radarsim: Command, tmp_path: Path) -> None:
    assert radarsim("figures", str(tmp_path)).code == 0
    page = tmp_path / "index.html"
    assert figures_on(page) == list(NUMBERS)
    assert set(contents(tmp_path)) == {*(e.file for e in FIGURES), "index.html"}
    for number, block in split_page(page.read_text(encoding="utf-8")).items():
        (caption,) = re.findall(r'<p class="caption">(.*?)</p>', block, re.DOTALL)
        assert len(caption) > 60
        assert caption.endswith(".")
        assert len(re.findall(r"[.?!](?: |$)", caption)) == 2
        assert f"radarsim figures OUT --only {number} --seed 0" in block


@pytest.mark.slow
def test_interrupted_run_leaves_only_complete_files(tmp_path: Path) -> None:
    only = "2,3,4,5,6,7,8,9,10,11,12"
    with start_radarsim("figures", str(tmp_path), "--only", only) as process:
        deadline = time.monotonic() + 240
        while not any(tmp_path.iterdir()) and time.monotonic() < deadline:
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 130
    found = contents(tmp_path)
    assert 0 < len(found) < len(FIGURES)
    assert all(data.endswith(b"IEND\xaeB`\x82") for data in found.values())
    assert set(found) <= {entry.file for entry in FIGURES}
