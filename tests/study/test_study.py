"""The study of radar and lasers: its maps, its estimates, its files."""

import itertools
import json
import math
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from commands import Run, run_in_process
from scipy import stats

from radarsim import __version__
from radarsim.evaluation.shortest_path import shortest_path
from radarsim.navigation.options import Algorithm
from radarsim.study.files import LOG, PAGE, TABLE, write_study
from radarsim.study.findings import find_losses, summary_sentences
from radarsim.study.maps import make_study_map
from radarsim.study.results import summarise
from radarsim.study.statistics import mean, share
from radarsim.study.tasks import (
    QUICK,
    ROBOT_RADIUS,
    StudyTask,
    run_study_task,
    study_tasks,
)

Row = dict[str, Any]


@pytest.mark.parametrize("successes", [0, 3, 10])
def test_shares_have_the_intervals_of_scipy(successes: int) -> None:
    interval = stats.binomtest(successes, 10).proportion_ci(method="wilson")
    estimate = share(successes, 10)
    assert (estimate.low, estimate.high) == pytest.approx(interval, abs=1e-12)


def test_means_have_the_intervals_of_scipy() -> None:
    values = [1.0, 1.5, 1.2, 4.0]
    estimate = mean(values)
    interval = stats.t.interval(0.95, 3, loc=estimate.value, scale=stats.sem(values))
    assert (estimate.low, estimate.high) == pytest.approx(interval)
    assert mean([2.0]).low == 2.0


def test_interval_of_a_mean_of_shares_ends_at_what_is_possible() -> None:
    estimate = mean([0.8, 1.0, 1.0])
    assert estimate.high > 1
    cut = estimate.within(0.0, 1.0)
    assert (cut.value, cut.low, cut.high) == (estimate.value, estimate.low, 1.0)


@pytest.mark.parametrize(
    ("kind", "is_passable"),
    [("smoke_corridor", True), ("hidden_room", False), ("dead_end", True)],
)
def test_maps_let_a_robot_through_or_not(kind: str, is_passable: bool) -> None:
    texts = set()
    for seed in range(3):
        map_ = make_study_map(kind, seed)
        path = shortest_path(map_.load(), map_.start, map_.goal, ROBOT_RADIUS)
        assert (path is not None) is is_passable
        texts.add(map_.text)
    assert len(texts) == 3
    assert make_study_map(kind, 1) == make_study_map(kind, 1)


def made_up_rows(change: Callable[[StudyTask, Row], None]) -> list[Row]:
    """Return rows of drives that all arrive and of maps that are whole, but changed."""
    rows = []
    for task in study_tasks(4, Algorithm.PLANNED):
        row: Row = {
            "seed": task.seed,
            "map": task.map,
            "sensor": task.sensor,
            "method": task.method,
            "outcome": "reached",
            "expected": "reached",
            "collisions": 0,
            "path_length": 12.0,
            "shortest_path": 10.0,
            "reachable_coverage": 1.0,
            "hidden_coverage": 0.0,
            "within_two_cells": 1.0,
            "time": 40.0,
            "note": "",
        }
        change(task, row)
        rows.append(row)
    return rows


def lose_in_the_office(task: StudyTask, row: Row) -> None:
    if (task.map, task.sensor) == ("office", "radar"):
        row["outcome"] = "no_path"
    if task.sensor == "radar":
        row["hidden_coverage"] = 0.9


def test_findings_tell_where_the_radar_wins_and_loses() -> None:
    summaries = summarise(made_up_rows(lose_in_the_office))
    assert summaries["office", "radar"].false_no_path == 4
    assert summaries["office", "sick"].success.value == 1.0
    ((is_clear, text),) = find_losses(summaries)
    assert is_clear
    assert "office" in text
    hidden = next(s for s in summary_sentences(summaries) if "bushes" in s)
    assert "`radar` 90 %" in hidden
    assert "`sick` 0 %" in hidden


def test_same_runs_give_the_same_files(tmp_path: Path) -> None:
    rows = made_up_rows(lose_in_the_office)
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        write_study(tmp_path / name, rows, algorithm=Algorithm.PLANNED, seeds=4)
    one, two = (
        {file.name: file.read_bytes() for file in (tmp_path / name).iterdir()}
        for name in ("one", "two")
    )
    assert one == two
    table = one[TABLE].decode().splitlines()
    assert len(table) == len(rows) + 1
    assert "radar_vs_laser.png" in one[PAGE].decode()


def test_laser_takes_smoke_for_a_wall() -> None:
    row = run_study_task(StudyTask(0, "smoke_corridor", "physical", "planned"))
    assert (row["expected"], row["outcome"]) == ("reached", "no_path")
    assert math.isclose(row["shortest_path"], 12.0, abs_tol=0.1)


def test_runs_of_another_version_are_refused(tmp_path: Path) -> None:
    row = {
        "seed": 0,
        "map": "office",
        "sensor": "radar",
        "method": "map",
        "outcome": "",
    }
    for version, told in (("0.0.1", __version__), (None, "a run of a study")):
        line = row if version is None else {"version": version, **row}
        (tmp_path / LOG).write_text(json.dumps(line) + "\n")
        run = run_study("-o", str(tmp_path))
        assert run.code == 2
        assert f"{LOG}:1" in run.err
        assert told in run.err


@pytest.mark.slow
def test_quick_study_is_the_same_after_a_kill(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert run_study("-o", str(folder), "--quick", "--workers", "1").code == 0
    before = {f.name: f.read_bytes() for f in folder.iterdir() if f.name != LOG}
    log = folder / LOG
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join(itertools.chain(lines[:-2], [lines[-1][:20]])))
    (folder / PAGE).unlink()
    assert run_study("-o", str(folder), "--quick").code == 0
    after = {f.name: f.read_bytes() for f in folder.iterdir() if f.name != LOG}
    assert after == before


def run_study(*options: str) -> Run:
    return run_in_process("study", "radar-vs-laser", *options)


def test_quick_study_takes_seeds_and_tells_only_what_ran(tmp_path: Path) -> None:
    page = quick_page(tmp_path, seeds=1)
    assert "Maps of 1 kind, each drawn anew for\n1 seed;" in page
    assert "explores" not in page
    assert "each sensor ran once on each map" in page
    assert "In this one run of each, the radar is behind the best laser" in page
    assert " to 100 %" not in page
    more = quick_page(tmp_path, seeds=3)
    assert "3 seeds;" in more
    assert "Intervals are of 95 %" in more
    assert " to 100 %" in more


def quick_page(folder: Path, seeds: int) -> str:
    """Return the page of a quick study whose runs are there already."""
    out = folder / f"{seeds}"
    out.mkdir()
    drive = {
        "expected": "reached",
        "outcome": "reached",
        "collisions": 0,
        "path_length": 12.6,
        "shortest_path": 12.0,
        "time": 40.0,
        "note": "",
    }
    with (out / LOG).open("w") as log:
        for task in study_tasks(seeds, Algorithm.PLANNED, QUICK):
            row = {**asdict(task), **drive, "version": __version__}
            log.write(json.dumps(row) + "\n")
    options = [] if seeds == 1 else ["--seeds", str(seeds)]
    assert run_study("-o", str(out), "--quick", *options).code == 0
    return (out / PAGE).read_text()
