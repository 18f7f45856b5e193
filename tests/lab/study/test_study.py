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
from radarsim.autonomy.evaluation.estimates import mean, share
from radarsim.autonomy.evaluation.shortest_path import shortest_path
from radarsim.autonomy.navigation.algorithms import ROBOT_RADIUS, Algorithm
from radarsim.lab.study.findings import find_losses, headline, summary_sentences
from radarsim.lab.study.maps import (
    MAPPING,
    QUICK,
    SENSORS,
    StudyTask,
    make_study_map,
    run_study_task,
    study_tasks,
)
from radarsim.lab.study.page import LOG, PAGE, TABLE, write_study
from radarsim.lab.study.results import summarise
from radarsim.presets.sensors import load_settings
from radarsim.rng import generator_for
from radarsim.sensors.range_scanner import load_sensor

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
    assert mean([0.1] * 3).is_exact
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
    assert summaries["office", "USARSim SICK"].success.value == 1.0
    ((is_clear, text),) = find_losses(summaries)
    assert is_clear
    assert "office" in text
    hidden = next(s for s in summary_sentences(summaries) if "bushes" in s)
    assert "radar 90 %" in hidden
    assert "USARSim SICK 0 %" in hidden
    assert "with every laser" in text
    verdicts = next(s for s in summary_sentences(summaries) if "all drives" in s)
    assert "radar 20 of 24, range-only radar 24 of 24," in verdicts


def test_who_gets_through_where_no_disc_does_is_right() -> None:
    def change(task: StudyTask, row: Row) -> None:
        if (task.map, task.sensor) == ("office", "radar"):
            row["expected"], row["shortest_path"] = "no_path", None

    summary = summarise(made_up_rows(change))["office", "radar"]
    assert summary.success.value == 1.0
    assert summary.false_no_path == 0


def test_paths_are_compared_on_the_same_maps() -> None:
    def change(task: StudyTask, row: Row) -> None:
        if task.map != "forest":
            return
        row["path_length"] += 2.0 * task.seed + 0.5 * (task.sensor == "USARSim SICK")
        row["time"] += task.seed
        if task.sensor == "USARSim SICK" and task.seed == 3:
            row["outcome"] = "no_path"

    summaries = summarise(made_up_rows(change))
    radar = summaries["forest", "radar"]
    sick = summaries["forest", "USARSim SICK"]
    assert radar.detour is not None
    assert sick.detour is not None
    assert sick.detour.value < radar.detour.value  # the longest drive is missing
    assert radar.detour_difference is None
    assert sick.detour_difference is not None
    assert sick.detour_difference.value == 0.05
    assert sick.detour_difference.is_exact
    assert sick.detour_difference.count == 3
    assert sick.time is not None
    assert (sick.time.value, sick.time.count) == (41.0, 3)


def lose_in_smoke(task: StudyTask, row: Row) -> None:
    """Let two lasers fail in smoke, one of them without a verdict."""
    if task.map != "smoke_corridor":
        return
    if task.sensor == "first-echo laser":
        row["outcome"] = "no_path"
    if task.sensor == "USARSim Hokuyo":
        row["outcome"] = "too_near" if task.seed else "failed"
        row["note"] = "" if task.seed else "the robot stays at 0 0"


def hide_the_floor(task: StudyTask, row: Row) -> None:
    lose_in_smoke(task, row)
    if task.sensor == "radar":
        row["hidden_coverage"] = 0.998 if task.seed else 0.999


def test_headline_names_the_lasers_that_arrive_too() -> None:
    smoke = (
        "hrough smoke all but first-echo laser and USARSim Hokuyo (none) arrive in"
        " 4 of 4"
    )
    summaries = summarise(made_up_rows(hide_the_floor))
    assert headline(summaries) == (
        "Behind bushes the radar maps 99.8 % of the floor, no laser any; t" + smoke
    )
    only_smoke = {key: each for key, each in summaries.items() if key[0] in QUICK}
    assert headline(only_smoke) == "T" + smoke


def test_headline_makes_no_win_of_what_a_laser_maps_too() -> None:
    def see_with_a_laser(task: StudyTask, row: Row) -> None:
        row["hidden_coverage"] = {"radar": 0.9, "USARSim SICK": 0.5}.get(
            task.sensor, 0.0
        )

    told = headline(summarise(made_up_rows(see_with_a_laser)))
    assert told.startswith(
        "Behind bushes the radar maps 90 % of the floor, the best laser 50 %;"
    )


def test_path_of_the_radar_is_compared_with_each_laser() -> None:
    def go_round(task: StudyTask, row: Row) -> None:
        if task.sensor == "USARSim Hokuyo":
            row["path_length"] = 15.0

    sentences = summary_sentences(summarise(made_up_rows(go_round)))
    (hedge,) = (text for text in sentences if "hedge" in text)
    same = "first-echo laser, last-echo laser and USARSim SICK"
    assert f"as good as with {same}, and shorter than with USARSim Hokuyo;" in hedge


def shut_in(task: StudyTask, row: Row) -> None:
    lose_in_smoke(task, row)
    if task.map != "office":
        return
    row["outcome"] = "reached" if task.method != MAPPING else "time_limit"
    if task.seed == 2:
        row["outcome"] = "no_path" if task.method != MAPPING else "explored"
        row["path_length"] = 0.0
        row["reachable_coverage"] = 0.25


def test_page_tells_how_runs_ended(tmp_path: Path) -> None:
    rows = made_up_rows(shut_in)
    write_study(tmp_path, rows, algorithm=Algorithm.PLANNED, seeds=4)
    page = (tmp_path / PAGE).read_text()
    ended = "USARSim Hokuyo got stuck in 1 drive and would not start in"
    assert f"No verdict: {ended}" in page
    assert "time limit: radar 3 of 4," in page
    assert "In the map of seed 2 no robot leaves" in page
    assert " 25 % of the floor" in page
    assert "1.20 <small>[n = 3]</small>" in page
    assert "In the room behind bushes and in the office it also explores" in page


def test_page_leaves_out_columns_without_values(tmp_path: Path) -> None:
    def stay(task: StudyTask, row: Row) -> None:
        if task.map == "hidden_room":
            row["expected"] = row["outcome"] = "no_path"

    rows = made_up_rows(stay)
    write_study(tmp_path, rows, algorithm=Algorithm.PLANNED, seeds=4)
    page = (tmp_path / PAGE).read_text()
    column = "<th>path / shortest path</th>"
    room = page.partition('id="hidden_room"')[2].partition("</table>")[0]
    assert column in page
    assert "<th>hidden floor</th>" in room
    assert column not in room


def test_page_tells_the_sensors_as_they_are(tmp_path: Path) -> None:
    page = quick_page(tmp_path, seeds=1)
    for name, sensor in SENSORS.items():
        settings = load_settings(sensor.preset, **sensor.settings)
        assert settings.max_range == (4 if "Hokuyo" in name else 80)
    assert "All but the Hokuyo reach 80 m" in page
    assert "laser_db_per_m: 2.3," in make_study_map("smoke_corridor", 0).text
    assert "2.3 dB" in page
    last = load_settings("physical", return_mode="last")
    assert last.margin_db == 40
    assert f"after {last.penetration_power / 2.3:.1f} m" in page


def test_lasers_of_one_preset_differ_by_the_echo_that_they_read() -> None:
    scene = make_study_map("smoke_corridor", 0).load()
    readings = {}
    for name in ("first-echo laser", "last-echo laser"):
        sensor = SENSORS[name]
        laser = load_sensor(sensor.preset, **sensor.settings)
        scan = laser.scan(scene, (-6, 0, 0), generator_for(0, "test"))
        readings[name] = scan.ranges[len(scan.ranges) // 2]
    assert readings["first-echo laser"] < 6
    assert math.isclose(readings["last-echo laser"], 13, abs_tol=0.01)


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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sensor", "touches"), [("range-only radar", True), ("radar", False)]
)
def test_radar_without_echoes_drives_into_what_it_sees_through(
    sensor: str, *, touches: bool
) -> None:
    row = run_study_task(StudyTask(0, "hidden_room", sensor, "planned"))
    # Who has touched the bushes knows of them as well.
    assert row["expected"] == row["outcome"] == "no_path"
    assert bool(row["collisions"]) is touches


def test_laser_takes_smoke_for_a_wall() -> None:
    row = run_study_task(StudyTask(0, "smoke_corridor", "first-echo laser", "planned"))
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
