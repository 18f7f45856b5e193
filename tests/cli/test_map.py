import json
import re
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import Popen
from typing import Any

import numpy as np
import pytest
from commands import run_in_process as radarsim
from PIL import Image
from processes import start_radarsim

from radarsim.addons.testing import UsarsimServer
from radarsim.client import Client
from radarsim.protocol.reports import RangeScan
from radarsim.scene.map_file import shipped_maps

FOLIAGE = ("foliage_room", "--time-limit", "3")
SEEN = ("empty_room", "--strategy", "frontiers")  # seen from the start
FILES = ["map.pgm", "map.png", "map.tum", "map.yaml", "map_view.png"]


fast_server = pytest.mark.usarsim(map="empty_room", speed=4)


@pytest.fixture
def server(usarsim_server: UsarsimServer) -> str:
    return f"127.0.0.1:{usarsim_server.address[1]}"


@pytest.fixture(scope="module")
def foliage_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    """Map the foliage room once; return the output and the folder of the files."""
    folder = tmp_path_factory.mktemp("foliage")
    return radarsim("map", "-o", folder, *FOLIAGE), folder


def test_map_is_written_and_summarised_in_lines(foliage_run: tuple[Any, Path]) -> None:
    run, folder = foliage_run
    where = re.escape(str(folder))
    assert run.code == 0
    assert re.fullmatch(
        r"time is up, exploring by auto: 0\.\d\d m in 3\.1 s, 32 scans\n"
        r"doubt    100% of the walls were seen from only one place: some may be images"
        r" in mirrors or glass\n"
        r"map      \d+\.\d\d m² free, \d\.\d\d m² obstacle, \d+\.\d\d m² foliage,"
        r" 0\.00 m² smoke\n"
        r"pose     0\.0\d\d m and 0\.\d\d degrees off, at most 0\.0\d\d m and"
        r" 0\.\d\d\n"
        r"truth    0\.\d\d m, \d\d\.\d% of the floor sensed, \d\d\.\d% at short range,"
        r" \d\d+\.\d% of the reachable floor,"
        r" \d\d\.\d% of the other floor, \d+ cells right,"
        r" \d+ wrong, collisions: 0\n"
        r"files    map_view\.png to look at; for programs map\.png, map\.pgm,"
        rf" map\.yaml, map\.tum; in {where}\n",
        run.text,
    )
    data = [line.split(" s  ")[1] for line in run.err.splitlines()]
    assert [line.split()[0] for line in data] == ["looking", "seeking"]
    assert re.search(r"path +0\.\d\d m +sensed +\d+\.\d m²$", data[-1])
    assert sorted(file.name for file in folder.iterdir()) == FILES


@pytest.mark.slow
def test_waypoints_are_driven_to_and_unreachable_ones_listed(tmp_path: Path) -> None:
    way = ("--way", "-7,1", "--way=-6,0", "--way", "0.5,0")
    run = radarsim("map", "-o", tmp_path, "foliage_room", *way, "--json")
    data = json.loads(run.text)
    assert (data["outcome"], data["strategy"]) == ("explored", "way")
    assert data["left_out"] == [[0.5, 0.0]]  # in the middle of a bush
    assert data["judge"]["collisions"] == 0
    assert data["path_length"] > 5
    run = radarsim("map", "-o", tmp_path, "foliage_room", "--way=9,9")
    assert "left out 9 9: no path" in run.text


def test_json_is_one_object(tmp_path: Path) -> None:
    run = radarsim("map", "-o", tmp_path / "room", *FOLIAGE, "--json", "--seed", "3")
    data = json.loads(run.text)
    assert list(data) == [
        *("outcome", "doubts", "strategy", "seed_from", "time", "path_length"),
        *("left_out", "safety_distance", "scans", "scans_left_out"),
        *("loop_closures", "cells"),
        *("pose_errors", "area_over_time", "files"),
        "error",
        "judge",
    ]
    assert (data["outcome"], data["strategy"]) == ("time_limit", "auto")
    assert (data["seed_from"], data["error"]) == ("ins", None)
    assert data["scans_left_out"] == {"no_pose": 0, "no_echoes": 0, "late": 0}
    assert data["cells"]["foliage"] > 1000
    assert data["cells"]["resolution"] == 0.05
    assert list(data["pose_errors"]) == [
        *("poses", "length", "ate", "ate_max", "rpe", "rpe_over"),
        "motion_ate",
        *("yaw_deg", "yaw_max_deg", "rpe_yaw_deg"),
    ]
    assert 0 < data["pose_errors"]["ate"] < 0.02
    assert data["pose_errors"]["rpe"] is None  # for less than 1 m
    curve = data["area_over_time"]
    assert curve["time"][-1] == pytest.approx(data["time"], abs=0.01)
    assert curve["path_length"][-1] == pytest.approx(data["path_length"], abs=0.01)
    cells = data["cells"]
    known = sum(cells[name] for name in ("free", "obstacle", "foliage", "smoke"))
    area = known * cells["resolution"] ** 2
    assert curve["area"][-1] == pytest.approx(area, rel=0.05)
    reached = data["judge"]["reachable_coverage"]
    assert curve["reachable_coverage"][-1] == pytest.approx(reached, abs=0.01)
    assert list(data["judge"]["reached"]) == ["0.5", "0.9", "0.99"]
    assert data["judge"]["reached"]["0.5"]["time"] < data["time"]
    assert data["judge"]["collisions"] == 0
    assert 0.2 < data["judge"]["hidden_coverage"] < 1
    assert data["judge"]["right"] > 1000 * data["judge"]["wrong"]
    assert data["judge"]["unknown"] > 1000
    assert [Path(file).name for file in data["files"]] == [
        *("room.png", "room.pgm", "room.yaml", "room.tum", "room_view.png")
    ]


@pytest.mark.slow
def test_same_seed_gives_the_same_map_and_another_seed_another(tmp_path: Path) -> None:
    for name, seed in (("a", "0"), ("b", "0"), ("c", "1")):
        radarsim("map", "-o", tmp_path / name, *SEEN, "--seed", seed)
    for ending in (".png", ".pgm", ".tum", "_view.png"):
        one, same, other = (
            (tmp_path / f"{name}{ending}").read_bytes() for name in "abc"
        )
        assert one == same
        assert one != other


def test_pictures_have_the_colours_of_usarcommander_and_nav2(
    foliage_run: tuple[Any, Path],
) -> None:
    _, folder = foliage_run
    with Image.open(folder / "map.png") as image:
        colours = {colour for _, colour in image.convert("RGB").getcolors() or ()}
    assert colours == {(0, 0, 255), (255, 255, 255), (160, 160, 160), (0, 0, 0)}
    with Image.open(folder / "map.pgm") as image:
        assert {*np.unique(np.asarray(image))} == {0, 205, 254}


@pytest.mark.slow
def test_map_of_probabilities_is_a_second_picture(tmp_path: Path) -> None:
    run = radarsim("map", "-o", tmp_path / "a.png", *SEEN, "--mode", "scale")
    assert run.code == 0
    assert sorted(file.name for file in tmp_path.iterdir()) == [
        *("a.png", "a.tum", "a_scale.png", "a_scale.yaml", "a_view.png")
    ]
    assert 'image: "a_scale.png"' in (tmp_path / "a_scale.yaml").read_text()


def test_options_reach_robot_and_mapper(tmp_path: Path) -> None:
    run = radarsim(
        *("map", "-o", f"{tmp_path}/new/", "empty_room", "--json"),
        *("--strategy", "centre_out", "--radius", "2", "--speed", "0.6"),
        *("--pose", "-7,1,90", "--motion-from", "odometry", "--no-echoes"),
        *("--foliage-density", "5", "--penetration-power", "2", "--resolution", "0.1"),
        *("--set", "lms200.max_range=15", "--drive-unit", "rev_per_s"),
        *("--scanner", "lms200", "--timeout", "1"),
    )
    data = json.loads(run.text)
    assert (run.code, data["outcome"]) == (0, "incomplete")  # beyond 2 m
    assert data["strategy"] == "centre_out"
    assert data["seed_from"] == "odometry"
    assert data["safety_distance"] == pytest.approx(0.37 + 0.4 + 0.13, abs=0.01)
    assert data["cells"]["resolution"] == 0.1
    assert data["path_length"] / data["time"] > 0.2
    lines = (tmp_path / "new" / "map.tum").read_text().splitlines()
    assert lines[1].split()[1:3] == ["-7.000000", "1.000000"]


def test_unwritable_places_are_reported_before_the_run(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    run = radarsim("map", "-o", f"{tmp_path}/file/", *SEEN)
    assert (run.code, run.out) == (2, b"")
    assert "cannot make" in run.err
    (tmp_path / "map.yaml").mkdir()
    run = radarsim("map", "-o", tmp_path, *SEEN)
    assert (run.code, run.out) == (2, b"")
    assert "it is a folder" in run.err
    (tmp_path / "x.gif").symlink_to("/dev/null")
    film = ("--film", str(tmp_path / "x.gif"))
    run = radarsim("map", "-o", tmp_path / "m", *SEEN, *film)
    assert (run.code, run.out) == (2, b"")
    assert "regular file" in run.err


@pytest.mark.slow
def test_map_of_a_stuck_robot_is_written(tmp_path: Path) -> None:
    run = radarsim(
        *("map", "-o", tmp_path, "foliage_room", "--no-echoes", "--json"),
        *("--strategy", "contour", "--pose", "-2,3.9,0"),
    )
    data = json.loads(run.text)
    assert (run.code, data["outcome"]) == (1, "stuck")
    assert data["error"].startswith("the robot stays at -0.")
    assert data["judge"]["wrong"] > 0
    assert f"radarsim: {data['error']}\n" in run.err
    assert sorted(file.name for file in tmp_path.iterdir()) == FILES


def test_robot_that_cannot_explore_is_an_error_and_no_file_is_written(
    tmp_path: Path,
) -> None:
    run = radarsim("map", "-o", tmp_path, *SEEN, "--robot", "P3AT", "--json")
    data = json.loads(run.text)
    assert (run.code, data["outcome"]) == (1, "failed")
    assert "sees 180 degrees" in data["error"]
    assert data["cells"] is data["pose_errors"] is None
    assert data["files"] == []
    run = radarsim("map", "-o", tmp_path, *SEEN, "--robot", "P3AT")
    assert (run.code, run.out) == (1, b"")
    assert not [*tmp_path.iterdir()]


@fast_server
def test_room_is_mapped_over_tcp(server: str, tmp_path: Path) -> None:
    words = ("map", "-o", str(tmp_path), "--connect", server, "--json")
    run = radarsim(*words, "--time-limit", "6")
    data = json.loads(run.text)
    assert (run.code, data["outcome"]) == (0, "time_limit")
    assert data["pose_errors"]["ate"] < 0.05
    assert "judge" not in data
    assert sorted(file.name for file in tmp_path.iterdir()) == FILES


@pytest.mark.slow
@fast_server
@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)]
)
def test_signal_ends_the_run_and_the_map_and_the_film_so_far_are_written(
    server: str, tmp_path: Path, number: int, code: int
) -> None:
    words = ("map", "-o", str(tmp_path), "--connect", server, "--json")
    film = tmp_path / "run.gif"
    with start_radarsim(*words, "--film", str(film)) as process:
        deadline = time.monotonic() + 240
        while not any(part.stat().st_size for part in tmp_path.glob(".*.part")):
            assert time.monotonic() < deadline, "no film has begun"
            time.sleep(0.01)
        process.send_signal(number)
        out, errors = process.communicate(timeout=240)
    data = json.loads(out)
    assert process.returncode == code
    assert (data["outcome"], data["error"]) == ("broken_off", "interrupted")
    assert len(data["files"]) == 5
    assert b"Traceback" not in errors
    with Image.open(film) as image:
        image.seek(getattr(image, "n_frames", 1) - 1)
        assert image.info["duration"] >= 2000
    assert sorted(file.name for file in tmp_path.iterdir()) == [*FILES, "run.gif"]


@pytest.mark.slow
def test_files_of_other_programs_are_not_overwritten(tmp_path: Path) -> None:
    for ending in (".png", ".pgm", ".yaml", ".tum", "_view.png"):
        (tmp_path / f"map{ending}").write_text("mine\n")
        run = radarsim("map", "-o", tmp_path, *FOLIAGE)
        assert run.code == 2
        assert f"map{ending}, which is another program's" in run.err
        (tmp_path / f"map{ending}").unlink()
    assert radarsim("map", "-o", tmp_path, *FOLIAGE).code == 0
    assert radarsim("map", "-o", tmp_path, *FOLIAGE).code == 0  # its own may go
    assert sorted(file.name for file in tmp_path.iterdir()) == FILES


def test_simulated_map_is_not_overwritten_beside_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = f"# radarsim map\n{shipped_maps()['empty_room'].read_text()}"
    Path("my_room.yaml").write_text(text)
    run = radarsim("map", "my_room.yaml", "--time-limit", "1")
    assert run.code == 2
    data = "overwrite my_room.yaml, which is the simulated map, expected another OUT"
    assert data in run.err
    assert Path("my_room.yaml").read_text() == text


def test_seed_of_turn_away_is_accepted_without_serve(
    server: str, tmp_path: Path
) -> None:
    words = ("--connect", server, "--strategy", "turn_away", "--seed", "3")
    run = radarsim("map", "-o", tmp_path, *words, "--time-limit", "0.5")
    assert (run.code, run.err.count("expected")) == (0, 0)


def test_full_disk_is_reported_in_json_and_leaves_the_old_map(
    foliage_run: tuple[Any, Path], tmp_path: Path
) -> None:
    old = (foliage_run[1] / "map.tum").read_bytes() + b"# more\n"
    (tmp_path / "map.tum").write_bytes(old)
    (tmp_path / "map.pgm").symlink_to("/dev/full")
    run = radarsim("map", "-o", tmp_path, *FOLIAGE, "--json")
    data = json.loads(run.text)
    assert run.code == 1
    why = "the disk is full"
    assert data["error"] == f"cannot write {tmp_path / 'map.pgm'}: {why}"
    assert (data["outcome"], data["files"]) == ("time_limit", [])
    assert data["judge"]["right"] > 1000
    assert "map.pgm: the disk is full" in run.err
    assert sorted(file.name for file in tmp_path.iterdir()) == ["map.pgm", "map.tum"]
    assert (tmp_path / "map.tum").read_bytes() == old


@contextmanager
def watching(server: str, folder: Path, *words: str) -> Iterator[Popen[bytes]]:
    """Start a program that waits for robot R1, to map what it reports."""
    words = ("--watch", "R1", "--connect", server, *words)
    with start_radarsim("map", "-o", str(folder), *words) as process:
        assert process.stderr is not None
        assert b"waiting" in process.stderr.readline()
        yield process


@pytest.mark.slow
@fast_server
def test_watched_robot_is_mapped_until_it_leaves(
    usarsim_server: UsarsimServer, server: str, tmp_path: Path
) -> None:
    with watching(server, tmp_path, "--json") as process:
        with Client.connect(*usarsim_server.address) as client:
            client.spawn("P3AT_Radar360", name="r1", start="RobotStart1")
            client.drive(*client.robot_info().wheel_speeds(0.5, 0.0))
            deadline, began = time.monotonic() + 240, client.session.time
            while client.session.time < began + 4 and time.monotonic() < deadline:
                client.read()
        out, _ = process.communicate(timeout=240)
    data = json.loads(out)
    assert process.returncode == 0
    assert (data["outcome"], data["error"]) == ("watched", None)
    assert data["path_length"] > 1
    assert data["pose_errors"]["ate"] < 0.05
    assert data["cells"]["free"] > 50_000
    assert sorted(file.name for file in tmp_path.iterdir()) == FILES


@pytest.mark.slow
@pytest.mark.usarsim(map="empty_room", dialect="udk", speed=4)
def test_watch_reports_which_motion_sources_a_robot_has(
    usarsim_server: UsarsimServer, server: str, tmp_path: Path
) -> None:
    with watching(server, tmp_path, "--motion-from", "odometry") as process:
        with Client.connect(*usarsim_server.address) as client:
            client.spawn("P3AT_Radar360", name="R1", start="RobotStart1")
            began = client.wait_for(RangeScan).time
            while client.wait_for(RangeScan).time < began + 4:
                pass
        _, errors = process.communicate(timeout=240)
    assert process.returncode == 1
    assert (
        b"radarsim: no map: no pose from odometry has come;"
        b" set the motion source to ins or none\n" in errors
    )
    assert not [*tmp_path.iterdir()]


@pytest.mark.slow
def test_no_map_is_written_of_a_robot_that_does_not_come(
    server: str, tmp_path: Path
) -> None:
    with watching(server, tmp_path) as process:
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=240)
    assert process.returncode == 1
    assert b"radarsim: no map: no scan has come\n" in errors
    assert not [*tmp_path.iterdir()]


@pytest.mark.slow
def test_film_shows_the_run_and_does_not_change_it(tmp_path: Path) -> None:
    words = ("empty_room", "--way=-7,0", "--json")
    plain = radarsim("map", "-o", tmp_path / "a", *words)
    films = [tmp_path / "a.gif", tmp_path / "b.gif"]
    runs = [
        radarsim("map", "-o", tmp_path / "b", *words, "--film", film) for film in films
    ]
    data = [json.loads(run.text) for run in (plain, *runs)]
    for each in data:
        del each["files"]
    assert data[0] == data[1] == data[2]
    for ending in (".png", ".tum", "_view.png"):
        one, other = ((tmp_path / f"{name}{ending}").read_bytes() for name in "ab")
        assert one == other
    assert films[0].read_bytes() == films[1].read_bytes()
    with Image.open(films[0]) as image:
        frames = getattr(image, "n_frames", 1)
        assert frames == pytest.approx(data[0]["time"] / 0.6, abs=2)
        first = np.asarray(image.convert("RGB"))
        image.seek(frames - 1)
        assert image.info["duration"] == 2000
        assert (np.asarray(image.convert("RGB")) != first).any()


@pytest.mark.slow
def test_film_that_cannot_be_written_does_not_spoil_the_map(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("radarsim.plotting.film.open_encoder", fail)
    film = tmp_path / "x.gif"
    run = radarsim("map", "-o", tmp_path, *SEEN, "--film", film)
    assert run.code == 2
    assert f"cannot write {film}: the disk is full" in run.err
    assert sorted(file.name for file in tmp_path.iterdir()) == FILES
    assert run.text.startswith("explored by frontiers")


def test_known_area_is_drawn_and_a_terminal_shows_a_status_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    plot, room = tmp_path / "area.svg", str(tmp_path / "room")
    run = radarsim("map", "-o", room, *FOLIAGE, "--plot", plot)
    assert "path   0.00 m  sensed" in run.err
    text = plot.read_text()
    assert text.startswith("<?xml")
    assert str(tmp_path) not in text
