"""Sweeps: their files and tables, in which neither workers nor kills show."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import Run, run_in_process

import radarsim
from radarsim.autonomy.evaluation.task_runner import run_batches
from radarsim.errors import SweepError
from radarsim.sweep.file import read_sweep, shipped_sweeps
from radarsim.sweep.results import ABOUT, LOG, TABLE, as_line, task_key
from radarsim.sweep.tasks import prepare_worker

parquet = pytest.importorskip("pyarrow.parquet")
distributed = pytest.importorskip("distributed")

SMALL = """\
version: 1
kind: scan
map: [foliage_room, mine@bare]
sensor: {name: radar, side_offset_uu: [0, 25.5], fov_deg: 40}
pose: {x: -7.8, y: {from: -1, to: 1, steps: 2}}
count: 3
"""
MANY_SCANS = SMALL.replace("steps: 2", "steps: 20")
TRIALS = """\
version: 1
kind: trial
map: [foliage_room, hedge_garden]
sensor: {name: radar, side_offset_uu: [0, 25]}
algorithm: [bug1, bug2]
seed: [0, 1, 2, 3, 4]
time_limit: 2
"""
MINE = """\
version: 1
materials: {stone: {density: opaque}}
objects:
  - {name: floor, box: [30, 30, 0.2], position: [0, 0, -0.1], material: stone}
  - {name: wall, box: [0.2, 20, 2], position: [2.1, 0, 1], material: stone}
variants: {bare: {}}
"""


@pytest.fixture(name="small")
def small_sweep(tmp_path: Path) -> Path:
    (tmp_path / "mine.yaml").write_text(MINE)
    file = tmp_path / "small.yaml"
    file.write_text(SMALL)
    return file


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out"


def sweep(file: Path | str, *options: object) -> Run:
    return run_in_process("sweep", file, *options)


def rows_of(folder: Path) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = parquet.read_table(folder / TABLE).to_pylist()
    return rows


def files_of(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def test_table_has_a_row_for_each_scan(small: Path, out: Path) -> None:
    assert sweep(small, "-o", out, "--workers", 1).code == 0
    rows = rows_of(out)
    assert len(rows) == 2 * 2 * 2 * 3
    assert len({row["task"] for row in rows}) == 8
    bare = [row for row in rows if row["map"] == "mine@bare"]
    angles = np.radians(np.arange(-20, 21))
    for row in bare:  # the wall is 9.8 m ahead, and nothing in between
        read = np.array(row["ranges"], float) * np.cos(angles)
        assert np.abs(read - 9.8).max() < 0.05
    assert {row["rays"][0] for row in rows} <= {-1, 0, 1}
    assert {row["error"] for row in rows} == {None}
    assert json.loads((out / ABOUT).read_text())["version"] == radarsim.__version__


def test_value_that_is_added_changes_no_other_row(small: Path) -> None:
    folder = small.parent
    sweep(small, "-o", folder / "before", "--workers", 1)
    more = SMALL.replace("[0, 25.5]", "[10, 0, 25.5]").replace("steps: 2", "steps: 3")
    small.write_text(more.replace("count: 3", "count: 4"))
    sweep(small, "-o", folder / "after", "--workers", 1)

    def by_parameters(name: str) -> dict[tuple[Any, ...], Any]:
        keys = ("map", "sensor.side_offset_uu", "y", "scan")
        rows = rows_of(folder / name)
        return {tuple(row[key] for key in keys): row["ranges"] for row in rows}

    before, after = by_parameters("before"), by_parameters("after")
    assert len(after) == 2 * 3 * 3 * 4
    assert {key: after[key] for key in before} == before


def test_killed_sweep_is_resumed_to_the_same_files(small: Path, out: Path) -> None:
    sweep(small, "-o", out, "--workers", 1)
    before = files_of(out)
    lines = before[LOG].decode().splitlines(keepends=True)
    (out / LOG).write_text("".join([lines[5], lines[2], lines[3][:50]]))
    (out / TABLE).unlink()
    refused = sweep(small, "-o", out)
    assert refused.code == 1
    assert "--resume" in refused.err
    again = sweep(small, "-o", out, "--resume", "--workers", 1)
    assert again.text.startswith("6 tasks, 18 scans in ")
    assert files_of(out) == before


def test_sweep_that_is_interrupted_while_it_writes_leaves_nothing_half_written(
    small: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(parquet.ParquetWriter, "write_table", interrupt)
        assert sweep(small, "-o", out, "--workers", 1).code == 130
    assert files_of(out).keys() == {ABOUT, LOG}
    assert sweep(small, "-o", out, "--resume").code == 0
    assert files_of(out).keys() == {ABOUT, LOG, TABLE}


def test_each_damaged_line_is_named_and_its_task_run_again(
    small: Path, out: Path
) -> None:
    sweep(small, "-o", out, "--workers", 1)
    before = files_of(out)
    draw = random.Random(9)
    for _ in range(10):
        log = bytearray(before[LOG])
        place = draw.randrange(len(log))
        log[place] = draw.choice(
            [each for each in b'A0"{,z}\xff' if each != log[place]]
        )
        (out / LOG).write_bytes(log)
        again = sweep(small, "-o", out, "--resume", "--workers", 1)
        assert again.code == 0
        if before[LOG][place : place + 1] != b"\n":
            number = before[LOG][:place].count(b"\n") + 1
            assert f"{out / LOG}:{number}: damaged, the task is run again" in again.err
        assert files_of(out) == before
    (out / LOG).write_bytes(b"[" * 100_000 + b"\n" + before[LOG])
    again = sweep(small, "-o", out, "--resume")
    assert (again.code, f"{LOG}:1: damaged" in again.err) == (0, True)
    assert files_of(out) == before


def test_another_sweep_does_not_replace_a_table(small: Path, out: Path) -> None:
    other = small.parent / "other.yaml"
    other.write_text(SMALL.replace("[0, 25.5]", "[0, 10]"))
    sweep(small, "-o", out, "--workers", 1)
    before = files_of(out)
    refused = sweep(other, "-o", out, "--resume", "--workers", 1)
    assert refused.code == 1
    assert "results of 'small.yaml' for 4 tasks that are not in 'other" in refused.err
    assert files_of(out) == before
    (out / TABLE).unlink()
    (out / ABOUT).unlink()  # as an old version leaves a sweep that was stopped
    refused = sweep(other, "-o", out, "--resume", "--workers", 1)
    assert "results of 'another file' for 4 tasks" in refused.err
    other.write_text(SMALL.replace("[0, 25.5]", "[0, 10, 25.5]"))
    assert sweep(other, "-o", out, "--resume", "--workers", 1).code == 0
    assert len(rows_of(out)) == 2 * 3 * 2 * 3


def test_stopped_sweep_says_what_it_was(
    small: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise SweepError("no table today")

    monkeypatch.setattr("radarsim.sweep.results._schema", fail)
    assert sweep(small, "-o", out, "--workers", 1).code == 1
    assert json.loads((out / ABOUT).read_text())["file"] == "small.yaml"


def test_failed_task_is_a_row_with_its_error(
    small: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail_sometimes(name: str, **settings: Any) -> Any:
        if settings["side_offset_uu"] == 0:
            raise RuntimeError("no such luck")
        return radarsim.load_sensor(name, **settings)

    monkeypatch.setattr("radarsim.sweep.tasks.load_sensor", fail_sometimes)
    run = sweep(small, "-o", out, "--workers", 1)
    assert run.code == 1
    assert "4 of 8 tasks failed" in run.err
    failed = [row for row in rows_of(out) if row["error"]]
    assert len(failed) == 4
    assert "no such luck" in failed[0]["error"]
    assert failed[0]["ranges"] is None
    monkeypatch.undo()
    assert sweep(small, "-o", out, "--resume", "--workers", 1).code == 0
    assert not any(row["error"] for row in rows_of(out))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("count", "counts", ":6:1: counts: unknown key"),
        ("name: radar", "name: radr", ":4:16: sensor.name: 'radr'"),
        ("25.5]", "-1]", "sensor.side_offset_uu"),
        ("steps: 2", "steps: 1", "small.yaml:5:20: pose.y: steps 1, expected 2"),
        ("kind: scan", "kind: trial", "'pose' is only for kind scan"),
        ("x: -7.8, ", "", "small.yaml:5:7: pose.x: missing"),
    ],
)
def test_mistakes_in_a_file_are_reported_with_their_place(
    small: Path, out: Path, old: str, new: str, message: str
) -> None:
    small.write_text(SMALL.replace(old, new))
    run = sweep(small, "-o", out)
    assert run.code == 1
    assert f"{small}:" in run.err
    assert message in run.err
    assert not out.exists()


@pytest.mark.parametrize("name", ["foliage_room", "foliage_room@dry", "{}/mine.yaml"])
def test_map_is_named_as_a_map(small: Path, name: str) -> None:
    name = name.format(small.parent)
    run = sweep(name, "-o", small.parent / "out")
    assert run.code == 1
    expected = "expected a sweep file, whose 'map' names maps, or one of "
    assert run.err.startswith(f"radarsim: {name}: is a map, {expected}['foliage_thick")


@pytest.mark.parametrize("by", ["map", "sensor.ray_weights", "sensor.name"])
def test_figure_is_drawn_of_values_of_any_kinds(
    small: Path, out: Path, by: str
) -> None:
    lists = "[0, 25.5], ray_weights: [[1, 1, 1], [1, 2, 1]]"
    small.write_text(SMALL.replace("[0, 25.5]", lists))
    assert sweep(small, "-o", out, "--workers", 1).code == 0
    script = Path(__file__).parents[2] / "examples" / "sweeps" / "figure.py"
    picture = out / "figure.png"
    words = (out / TABLE, picture, "sensor.side_offset_uu=N, UU", by, "1")
    subprocess.run([sys.executable, script, *words], check=True)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_dry_run_counts_and_writes_nothing(small: Path, out: Path) -> None:
    assert sweep(small, "-o", out, "--dry-run").text == "8 tasks, 24 scans\n"
    assert not out.exists()


def test_worker_and_results_of_another_version_are_refused(
    small: Path, out: Path
) -> None:
    with pytest.raises(SweepError, match=r"expected local version 0\.0\.1"):
        prepare_worker("0.0.1", {})
    out.mkdir()
    (out / LOG).write_text(as_line({"version": "0.0.1", "task": "x", "rows": []}))
    run = sweep(small, "-o", out, "--resume")
    assert run.code == 1
    assert f"{LOG}:1: a task of radarsim '0.0.1'" in run.err


def test_key_depends_on_the_parameters_alone() -> None:
    assert task_key({"a": 1, "b": [2]}) == task_key({"b": [2], "a": 1})
    assert task_key({"a": 1}) != task_key({"a": 1.5})


def test_shipped_sweeps_are_right() -> None:
    for name in shipped_sweeps():
        path, read = read_sweep(name)
        tasks = list(read.tasks())
        assert len(tasks) * read.count >= 2000
        assert path.stem == name


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["trial", "map"])
def test_trials_and_maps_are_judged(tmp_path: Path, kind: str) -> None:
    file = tmp_path / "runs.yaml"
    map_ = "foliage_room" if kind == "trial" else "empty_room"
    file.write_text(
        f"version: 1\nkind: {kind}\nmap: {map_}\nsensor: {{name: sick}}\n"
        "time_limit: 60\n"
    )
    assert sweep(file, "-o", tmp_path / "out", "--workers", 1).code == 0
    (row,) = rows_of(tmp_path / "out")
    assert row["collisions"] == 0
    assert row["path_length"] > 5
    if kind == "trial":
        assert row["outcome"] == "reached"
        assert row["shortest_path"] <= row["path_length"] + 0.2
    else:
        assert 0.5 < row["reachable_coverage"] <= 1


@contextmanager
def dask_cluster(workers: int, prepare: str = "pass") -> Iterator[str]:
    """Start a scheduler with worker processes; ``prepare`` is done before its use."""
    script = (
        "import threading, time\n"
        "from distributed import LocalCluster\n"
        "if __name__ == '__main__':\n"
        f"    with LocalCluster({workers}, threads_per_worker=1,\n"
        "                      dashboard_address=None, host='127.0.0.1') as cluster:\n"
        f"        {prepare}\n"
        "        print(cluster.scheduler_address, flush=True)\n"
        "        input()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
        process.communicate("\n")


@pytest.fixture(name="cluster")
def cluster_of_two() -> Iterator[str]:
    with dask_cluster(2) as address:
        yield address


@pytest.mark.slow
def test_cluster_that_starts_empty_is_waited_for(small: Path) -> None:
    one, adaptive = small.parent / "one", small.parent / "adaptive"
    sweep(small, "-o", one, "--workers", 1)
    # A local cluster cannot be made without workers.
    empty = "cluster.scale(0); time.sleep(3); cluster.adapt(minimum=0, maximum=2)"
    with dask_cluster(1, empty) as address:
        run = sweep(small, "-o", adaptive, "--scheduler", address)
    assert run.code == 0
    assert (
        run.err == f"radarsim: {address} has no workers; waiting up to 120 s for one\n"
    )
    assert files_of(adaptive) == files_of(one)


@pytest.mark.slow
def test_sweep_goes_on_when_somebody_restarts_the_cluster(
    small: Path, cluster: str
) -> None:
    small.write_text(TRIALS)
    one, restarted = small.parent / "one", small.parent / "restarted"
    sweep(small, "-o", one, "--workers", 2)

    def restart() -> None:
        while not logged(restarted):
            time.sleep(0.01)
        with distributed.Client(cluster) as client:
            client.restart()

    with ThreadPoolExecutor(1) as thread:
        restarting = thread.submit(restart)
        run = sweep(small, "-o", restarted, "--scheduler", cluster)
        restarting.result()
    assert run.code == 0
    assert files_of(restarted) == files_of(one)


@pytest.mark.slow
def test_task_that_kills_its_worker_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """joblib's backend for dask would wait for it for ever."""

    def run(number: int) -> int:
        return os._exit(number)

    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "0")
    with dask_cluster(1) as address, distributed.Client(address) as client:
        executor = client.get_executor(pure=False)
        ((_, value, error),) = run_batches(executor, run, [(1,)], 1, lambda: 1)
    assert value is None
    assert "killed or crashed" in error


@pytest.mark.slow
@pytest.mark.parametrize("text", [MANY_SCANS, TRIALS], ids=["scans", "trials"])
def test_workers_a_cluster_and_a_kill_give_the_same_files(
    text: str, small: Path, cluster: str
) -> None:
    small.write_text(text)
    folder = small.parent
    options = {
        "one": ("--workers", "1"),
        "two": ("--workers", "2"),
        "cluster": ("--scheduler", cluster),
        "killed": ("--workers", "2", "--resume"),
    }
    kill_sweep(small, folder / "killed")
    for name, given in options.items():
        run = sweep(small, "-o", folder / name, *given)
        assert (run.code, run.err) == (0, "")
    one, *others = (files_of(folder / name) for name in options)
    assert len(one[LOG].splitlines()) == 40 * (1 + (text == MANY_SCANS))
    assert others == [one] * 3


def kill_sweep(file: Path, out: Path) -> None:
    """Start a sweep with two workers, and kill them all after its first results."""
    command = [sys.executable, "-m", "radarsim", "sweep", str(file), "-o", str(out)]
    with subprocess.Popen(
        [*command, "--workers", "2"], start_new_session=True, stderr=subprocess.PIPE
    ) as process:
        while process.poll() is None and not logged(out):
            time.sleep(0.01)
        with suppress(ProcessLookupError):  # it has ended by itself meanwhile
            os.killpg(process.pid, signal.SIGKILL)
    assert logged(out)


def logged(out: Path) -> bytes:
    """Return what a sweep has logged."""
    return (out / LOG).read_bytes() if (out / LOG).is_file() else b""


@pytest.mark.slow
def test_cluster_of_another_version_is_refused(
    small: Path, cluster: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("radarsim.sweep.cli.__version__", "9.9")
    run = sweep(small, "-o", small.parent / "refused", "--scheduler", cluster)
    assert run.code == 1
    assert f"radarsim {radarsim.__version__}, expected local version 9.9" in run.err
