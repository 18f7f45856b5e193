"""``radarsim navigate``, against its own simulation and over TCP."""

import csv
import json
import math
import re
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import run_in_process as radarsim
from PIL import Image
from processes import start_radarsim

from radarsim.autonomy.cli.navigate_output import headline
from radarsim.autonomy.evaluation.navigation_run import INTERRUPTED, NavigationRun
from radarsim.autonomy.navigation.runner import Result
from radarsim.autonomy.plans import Algorithm, Mission
from radarsim.protocol.commands import Drive, parse_command
from radarsim.protocol.dialect import COMPAT
from radarsim.scene.scene import Scene
from radarsim.server.host import Diagnostic, Host
from radarsim.server.server_thread import ServerThread

BUG2 = ("navigate", "--algorithm", "bug2")
BOX = (*BUG2, "bug_box", "--speed", "0.6")
NEAR = (*BUG2, "--goal", "-6.5,0")  # of RobotStart1 in the empty room
FAR = (*BUG2, "--goal", "8,0")
BoxRun = tuple[dict[str, Any], Path, Path]


class FaultyHost(Host):
    """Records DRIVE commands, and can fail 3 s after the first one.

    Then it sends nothing (``stalls``) or no scans (``mute``), or it closes connections
    (``drops``).
    """

    def __init__(self, scene: Scene, fault: str) -> None:
        super().__init__(scene)
        self.driven: list[tuple[float, Drive]] = []
        self._fault = fault

    def failure(self) -> str:
        begins = self.driven[0][0] + 3.0 if self.driven else math.inf
        return self._fault if self.simulation.time > begins else ""

    def receive(self, number: int, data: bytes) -> list[Diagnostic]:
        for line in data.decode().splitlines():
            command = parse_command(line, COMPAT)[0]
            if isinstance(command, Drive):
                self.driven.append((self.simulation.time, command))
        return super().receive(number, data)

    def take(self, number: int) -> bytes:
        lines = super().take(number).splitlines(keepends=True)
        left_out = {"stalls": b"", "mute": b"{Type RangeScanner}"}.get(self.failure())
        return b"".join(s for s in lines if left_out is None or left_out not in s)

    def close_reason(self, number: int) -> str:
        failure = self.failure()
        return failure if failure == "drops" else super().close_reason(number)

    def wait_for_stop(self) -> float:
        """Wait until the robot is stopped, and return when, s."""
        deadline = time.monotonic() + 240
        while self.driven[-1][1] != Drive(0.0, 0.0) and time.monotonic() < deadline:
            time.sleep(0.01)
        assert self.driven[-1][1] == Drive(0.0, 0.0)
        return self.driven[-1][0]


Serve = Callable[..., tuple[FaultyHost, str]]


@pytest.fixture
def serve(empty_room: Scene) -> Iterator[Serve]:
    """Return a function that serves a room, and gives the host and its address."""
    threads: list[ServerThread] = []

    def begin(fault: str = "") -> tuple[FaultyHost, str]:
        host = FaultyHost(empty_room, fault)
        threads.append(ServerThread(host, speed=6.0))
        return host, "{}:{}".format(*threads[-1].begin())

    yield begin
    for each in threads:
        each.finish()


def test_reached_goal_is_summarised_in_lines() -> None:
    run = radarsim(*BOX)
    assert run.code == 0
    assert re.fullmatch(
        r"goal reached by bug2: 4\.00 -0\.40\n"
        r"path +1\d\.\d\d m in \d+\.\d s; nearest obstacle 0\.\d\d m\n"
        r"hit points +-2\.\d\d -0\.4\d\n"
        r"leave points +[12]\.\d\d -0\.\d\d\n"
        r"circuits +0\n"
        r"true path +1\d\.\d\d m, collisions: 0, 0\.\d\d m from the goal\n",
        run.text,
    )
    data = [line.split(" s  ")[1] for line in run.err.splitlines()]
    assert data[0] == "going to 4.00 -0.40, 8.00 m away"
    assert re.fullmatch(r"hit point 1 at -2\.\d\d -0\.4\d, aligning", data[1])
    assert data[2] == "following"
    assert data[3].startswith("leave point 1 at ")
    assert data[4:] == ["reached"]


@pytest.fixture(scope="module")
def box_run(tmp_path_factory: pytest.TempPathFactory) -> BoxRun:
    """Run through the box; return the summary, the trace and the picture."""
    folder = tmp_path_factory.mktemp("box")
    trace, plot = folder / "run.csv", folder / "run.PNG"
    run = radarsim(*BOX, "--json", "--trace", trace, "--plot", plot)
    assert run.code == 0
    return json.loads(run.text), trace, plot


def test_json_is_one_object_that_agrees_with_the_judge(box_run: BoxRun) -> None:
    data, *_ = box_run
    assert list(data) == [
        *("outcome", "algorithm", "goals", "goals_left", "path_length", "time"),
        *("hit_points", "leave_points", "circuits", "legs", "nearest_obstacle"),
        *("safety_distance", "error", "judge"),
    ]
    assert (data["outcome"], data["algorithm"]) == ("reached", "bug2")
    assert (data["goals"], data["goals_left"]) == ([[4.0, -0.4]], 0)
    assert (data["safety_distance"], data["error"]) == (0.5, None)
    assert len(data["hit_points"]) == len(data["leave_points"]) == 1
    judge = data["judge"]
    assert judge["collisions"] == 0
    assert judge["goal_distance"] < 0.5
    assert judge["path_length"] == pytest.approx(data["path_length"], rel=0.05)


@pytest.mark.parametrize("way", ["option", "trial"])
def test_goal_outside_the_box_around_all_objects_is_driven_to(
    tmp_path: Path, way: str
) -> None:
    file, options = tmp_path / "pole.yaml", ["--goal=-1.5,2"]
    text = """
version: 1
objects: [{name: pole, box: [0.2, 0.2, 1], material: metal}]
starts: [{name: RobotStart1, position: [-2.5, 2, 0]}]
"""
    if way == "trial":
        text += "trial: {start: RobotStart1, goal: [-1.5, 2], safety_distance: 0.5}"
        options = []
    file.write_text(text)
    data = json.loads(radarsim(*BUG2, file, "--json", *options).text)
    assert (data["outcome"], data["goals"]) == ("reached", [[-1.5, 2.0]])


def test_same_seed_gives_the_same_run_and_another_seed_another() -> None:
    first, again, other = (
        radarsim(*BOX, "--json", "--time-limit", "5", "--seed", seed).text
        for seed in "001"
    )
    assert first == again != other


def test_each_goal_is_reported_and_the_last_is_the_start(tmp_path: Path) -> None:
    file = tmp_path / "post.yaml"
    file.write_text(
        "version: 1\nobjects: [{name: post, box: [0.4, 0.4, 1], material: metal}]\n"
        "starts: [{name: RobotStart1, position: [-2, -0.1, 0]}]\n"
    )
    way = ("--goal=-1.3,-0.1", "--goal=1.2,-0.1", "--return-to-start", "--speed", "0.6")
    data = json.loads(radarsim(*BUG2, file, *way, "--json").text)
    assert data["goals"][:2] == [[-1.3, -0.1], [1.2, -0.1]]
    assert math.dist(data["goals"][2], (-2, -0.1)) < 0.1
    assert [leg["goal"] for leg in data["legs"]] == data["goals"]
    assert [leg["outcome"] for leg in data["legs"]] == ["reached"] * 3
    assert [len(leg["hit_points"]) for leg in data["legs"]] == [0, 1, 1]
    leave_points = [point for leg in data["legs"] for point in leg["leave_points"]]
    assert leave_points == data["leave_points"]
    lengths = [leg["path_length"] for leg in data["legs"]]
    assert sum(lengths) == pytest.approx(data["path_length"], abs=0.01)
    # from where it truly started, though it knows that place by its own pose
    assert data["judge"]["goal_distance"] < 0.3


def test_goal_to_which_there_is_no_path_is_reported_among_several() -> None:
    way = ("--goal", "-3.5,-0.5", "--goal", "-0.4,0.2", "--return-to-start")
    run = radarsim(*BUG2, "bug_closed_box", "--speed", "0.5", *way)
    assert run.code == 3
    assert run.text.startswith("no path by bug2: ")
    assert re.search(r"\ngoal 1 +-3\.50 -0\.50: reached, \d\.\d\d m in", run.text)
    assert re.search(r"\ngoal 2 +-0\.40 0\.20: no path, 1\d\.\d\d m in", run.text)
    assert "goal 3" not in run.text
    assert re.search(r"collisions: 0, \d\.\d\d m from its start\n$", run.text)


def test_goal_not_reached_in_time_is_a_failure() -> None:
    run = radarsim(*BOX, "--time-limit", "2", "--json")
    data = json.loads(run.text)
    assert run.code == 1
    assert (data["outcome"], data["goals_left"]) == ("failed", 1)
    assert data["error"].startswith("goal not reached within 2 s, 6.")
    assert run.err.endswith(f"radarsim: {data['error']}\n")
    run = radarsim(*BOX, "--time-limit", "2", "--goal", "-2.5,-0.4", "--goal", "4,-0.4")
    assert re.search(r" m from the last goal\n$", run.text)
    run = radarsim(*BOX, "--time-limit", "2", "--return-to-start")
    assert "radarsim: goal 1 of 2 not reached within 2 s, 6." in run.err


def test_impossible_mission_is_reported_in_json() -> None:
    run = radarsim(*BOX, "--safety-distance", "0.2", "--json")
    data = json.loads(run.text)
    assert run.code == 1
    assert data["outcome"] == "failed"
    assert data["error"].startswith("safety distance 0.2 m, expected at least 0.371 m")
    assert data["nearest_obstacle"] is None
    assert f"radarsim: {data['error']}\n" in run.err


def test_options_reach_robot_and_bug() -> None:
    run = radarsim(
        *(*BUG2, "empty_room", "--pose", "-8,1,90", "--goal", "-8,2.5"),
        *("--bumpers", "4", "--share", "0.5", "--rule", "share", "--side", "right"),
        *("--give-up", "line", "--pose-from", "ground_truth", "--speed", "0.5"),
        *("--drive-unit", "rev_per_s", "--foliage-density", "5", "--scanner", "lms200"),
        *("--set", "lms200.sensor=laser", "--set", "lms200.fov_deg=359", "--json"),
        *("--set", "lms200.resolution_deg=1", "--goal", "-7,2.5", "--timeout", "0.8"),
        *("--time-limit", "inf"),
    )
    data = json.loads(run.text)
    assert run.code == 0
    assert data["goals"] == [[-8.0, 2.5], [-7.0, 2.5]]
    assert data["safety_distance"] == pytest.approx(0.37 + 0.2 + 0.13, abs=0.01)
    assert data["path_length"] / data["time"] > 0.3


def test_trace_and_picture_show_the_run(box_run: BoxRun) -> None:
    data, trace, plot = box_run
    rows = list(csv.DictReader(trace.read_text().splitlines()))
    times = [float(row["time"]) for row in rows]
    assert np.diff(times) == pytest.approx(0.1)
    assert data["time"] == pytest.approx(times[-1] - times[0])
    places = [(float(row["x"]), float(row["y"])) for row in rows]
    steps = map(math.dist, places, places[1:])
    assert sum(steps) == pytest.approx(data["path_length"], abs=0.02)
    assert {row["doing"] for row in rows} == {
        *("going", "aligning", "following", "reached")
    }
    assert min(float(row["nearest"]) for row in rows) == pytest.approx(
        data["nearest_obstacle"], abs=1e-3
    )
    assert any("front" in row["pressed"].split() for row in rows)
    with Image.open(plot) as image:
        assert image.format == "PNG"
    assert {*trace.parent.iterdir()} == {trace, plot}


def test_start_in_a_bush_is_an_error_that_names_it(tmp_path: Path) -> None:
    path = tmp_path / "bush.yaml"
    path.write_text(
        "version: 1\nmaterials: {leaves: {density: 0.7}}\nobjects:\n"
        "  - {name: juniper, sphere: 2.0, position: [-5, 0, 0.6], material: leaves}\n"
        "starts: [{name: RobotStart1, position: [-5, 0, 0]}]\n"
    )
    for command in ([*BUG2, "--goal=-6,1"], ["map", "-o", str(tmp_path / "o/")]):
        run = radarsim(*command, path)
        assert run.code == 1
        assert "INIT at (-5.00, 0.00) in ['juniper'], expected a free place" in run.err


def test_robot_turns_to_a_heading_at_the_goal(tmp_path: Path) -> None:
    trace = tmp_path / "run.csv"
    run = radarsim(*NEAR, "empty_room", "--heading", "-120", "--trace", trace)
    assert run.code == 0
    assert "turning" in run.err
    last = list(csv.DictReader(trace.read_text().splitlines()))[-1]
    assert float(last["yaw"]) == pytest.approx(math.radians(-120), abs=0.05)
    assert last["doing"] == "reached"
    refused = radarsim(*NEAR, "empty_room", "--heading", "north")
    assert (refused.code, "'north', expected DEG" in refused.err) == (2, True)


def test_trace_overwrites_only_traces(tmp_path: Path) -> None:
    trace = tmp_path / "run.csv"
    trace.write_text("my,own,table\n1,2,3\n")
    command = [*NEAR, "empty_room", "--trace", str(trace)]
    run = radarsim(*command)
    assert run.code == 2
    assert "run.csv exists and is not a trace, expected another name" in run.err
    assert trace.read_text() == "my,own,table\n1,2,3\n"
    trace.unlink()
    assert radarsim(*command).code == 0
    first = trace.read_bytes()
    assert radarsim(*command).code == 0
    assert trace.read_bytes() == first


def test_files_of_a_failed_run_are_written(tmp_path: Path) -> None:
    trace, plot = tmp_path / "run.csv", tmp_path / "run.svg"
    run = radarsim(
        *(*BUG2, "foliage_room", "--start", "RobotStart1", "--goal", "8,0"),
        *("--time-limit", "5", "--trace", trace, "--plot", plot),
    )
    assert run.code == 1
    assert "goal not reached within 5 s" in run.err
    rows = list(csv.DictReader(trace.read_text().splitlines()))
    assert len(rows) > 40
    assert plot.read_text().startswith("<?xml")


def test_terminal_shows_a_live_status_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    run = radarsim(*BOX, "--time-limit", "2")
    assert "goal   6." in run.err
    assert "m  nearest " in run.err
    assert "going to" not in run.err


def test_goal_is_reached_over_tcp(serve: Serve) -> None:
    host, address = serve()
    run = radarsim(*NEAR, "--connect", address, "--json")
    data = json.loads(run.text)
    assert (run.code, data["outcome"]) == (0, "reached")
    assert data["path_length"] == pytest.approx(1.4, abs=0.2)
    assert "judge" not in data
    host.wait_for_stop()


@pytest.mark.parametrize(
    ("fault", "text"),
    [
        ("stalls", "no scan of 'lms200' within 0.8 s, nothing received"),
        ("mute", "no scan of 'lms200' within 0.8 s, received only: "),
        ("drops", ""),  # an end or a reset, as it comes
    ],
)
def test_robot_is_stopped_when_the_server_fails(
    serve: Serve, fault: str, text: str
) -> None:
    host, address = serve(fault)
    run = radarsim(*FAR, "--connect", address, "--timeout", "0.8")
    assert (run.code, run.out) == (1, b"")
    assert f"radarsim: {text}" in run.err
    if fault != "drops":  # nobody hears it any more
        assert host.wait_for_stop() > host.driven[0][0] + 3.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)]
)
def test_signal_stops_the_robot_and_the_trace_is_written(
    serve: Serve, tmp_path: Path, number: int, code: int
) -> None:
    (host, server), trace = serve(), tmp_path / "run.csv"
    with start_radarsim(*FAR, "--connect", server, "--trace", str(trace)) as process:
        deadline = time.monotonic() + 240
        while len(host.driven) < 11 and time.monotonic() < deadline:
            time.sleep(0.01)
        process.send_signal(number)
        out, errors = process.communicate(timeout=240)
    assert process.returncode == code
    assert out.startswith(b"interrupted by bug")
    assert b"Traceback" not in errors
    host.wait_for_stop()
    rows = list(csv.DictReader(trace.read_text().splitlines()))
    assert len(rows) >= 10
    assert all(None not in row.values() for row in rows)
    assert [*tmp_path.iterdir()] == [trace]


@pytest.mark.slow
def test_film_shows_the_run_and_does_not_change_it(tmp_path: Path) -> None:
    words = (*BOX, "--time-limit", "2", "--json")
    films = [tmp_path / "a.gif", tmp_path / "b.gif"]
    runs = [radarsim(*words), *(radarsim(*words, "--film", f) for f in films)]
    assert {run.text for run in runs} == {runs[0].text}
    assert {run.code for run in runs} == {1}
    assert films[0].read_bytes() == films[1].read_bytes()
    with Image.open(films[0]) as image:
        frames = getattr(image, "n_frames", 1)
        assert frames == pytest.approx(2 / 0.6, abs=2)
        image.seek(frames - 1)
        assert image.info["duration"] >= 2000


def test_headline_says_how_a_run_ended() -> None:
    mission = Mission(algorithm=Algorithm.BUG1, goals=((1.0, 0.0),))
    run = NavigationRun(mission, None)
    assert headline(run) == "Bug1 fails"
    run.error = INTERRUPTED
    assert headline(run) == "Bug1, interrupted"
    for outcome, text in (("reached", "reaches its goal"), ("no_path", "no path")):
        run.result = Result(outcome, 1.0, 1.0, 0, 0, 0.5)
        run.error = ""
        assert text in headline(run)
