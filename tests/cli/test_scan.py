import csv
import io
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import Run
from commands import run_in_process as radarsim
from PIL import Image
from processes import on_terminal

START = ("--start", "RobotStart1")
FAR_SIDE = 1.8  # m; no bush of the foliage room reaches so far in x


def ends(printed: dict[str, Any]) -> "np.ndarray[Any, np.dtype[np.float64]]":
    """Give x of the readings of a level scan that looks along x."""
    ranges = np.array([math.inf if r is None else r for r in printed["ranges"]])
    angles = printed["angle_min"] + printed["angle_increment"] * np.arange(len(ranges))
    along: np.ndarray[Any, np.dtype[np.float64]] = ranges * np.cos(angles)
    along += printed["pose"][0]
    return along


def scan(map_: str, sensor: str, *options: object) -> Run:
    run = radarsim("scan", map_, "--sensor", sensor, *START, *options)
    assert run.code == 0
    return run


@pytest.mark.parametrize("seed", range(5))
def test_radar_sees_through_foliage_in_some_directions(seed: int) -> None:
    printed = json.loads(scan("foliage_room", "radar", "--seed", seed).text)
    x = ends(printed)
    assert len(x) == 181
    assert np.count_nonzero(x > FAR_SIDE) >= 8
    y = printed["ranges"] * np.sin(np.radians(np.arange(-90, 91)))
    inside = (x > -0.7) & (x < FAR_SIDE) & (np.abs(y) < 6.2)
    assert np.count_nonzero(inside) >= 8


def test_hokuyo_does_not_see_through_foliage() -> None:
    printed = json.loads(scan("foliage_room", "hokuyo", "--set", "max_range=80").text)
    assert len(printed["ranges"]) == 228
    assert printed["rays"] is None
    assert np.max(ends(printed)) < FAR_SIDE


def test_hokuyo_is_blind_in_smoke() -> None:
    assert json.loads(scan("smoke_room", "hokuyo").text)["ranges"] == [0.0] * 228


def test_start_is_the_pose_of_a_p3ats_scanner() -> None:
    printed = json.loads(scan("empty_room", "laser").text)
    assert printed["pose"] == pytest.approx([-7.7915, 0, 0.346, 0, 0, 0])


def test_pose_of_three_numbers_equals_one_of_six() -> None:
    three, six = (
        radarsim("scan", "empty_room", "--sensor", "laser", "--pose", pose)
        for pose in ("-4,1,30", "-4,1,0.346,0,0,30")
    )
    assert json.loads(three.text)["pose"][5] == pytest.approx(math.radians(30))
    assert three.text == six.text


def test_several_scans_are_a_list_and_differ() -> None:
    text, again = (scan("empty_room", "radar", "--count", "3").text for _ in range(2))
    scans = json.loads(text)
    assert len(scans) == 3
    assert scans[0]["rays"] != scans[1]["rays"]
    assert text == again


def test_csv_has_a_row_for_each_beam() -> None:
    short = ("--set", "max_range=3", "--count", "2")
    run = scan("empty_room", "laser", *short, "--format", "csv")
    rows = list(csv.DictReader(io.StringIO(run.text)))
    assert len(rows) == 2 * 181
    assert list(rows[0]) == ["scan", "beam", "angle", "range", "ray"]
    assert {row["range"] for row in rows[80:100]} == {""}


def test_picture_shows_violet_rays_and_the_floor_plan(tmp_path: Path) -> None:
    path = tmp_path / "scan.png"
    assert scan("foliage_room", "radar", "-o", path).out == b""
    with Image.open(path) as image:
        pixels = np.asarray(image.convert("RGB"), np.int16).reshape(-1, 3)
    red, green, blue = pixels.T
    assert np.count_nonzero((blue > red + 80) & (red > green + 20)) > 200
    assert np.count_nonzero((green > red + 20) & (green > blue + 40)) > 5000
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("ending", "head"),
    [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF"), ("SVG", b"<?xml")],
)
def test_ending_of_a_picture_is_its_format(
    tmp_path: Path, ending: str, head: bytes
) -> None:
    path = tmp_path / f"scan.{ending}"
    scan("empty_room", "laser", "-o", path)
    assert path.read_bytes().startswith(head)


def test_file_without_an_ending_holds_json(tmp_path: Path) -> None:
    path = tmp_path / "scan"
    scan("empty_room", "laser", "-o", path)
    assert len(json.loads(path.read_text())["ranges"]) == 181


def test_terminal_gets_a_summary_and_how_to_get_the_numbers() -> None:
    text = on_terminal("scan", "empty_room", "--sensor", "laser", *START)
    lines = text.removesuffix("\x1b[0m").splitlines()
    *_, first, second, last = lines
    assert first.endswith("laser at -7.79 0.00 0.35, 181 of 181 beams return")
    assert second.startswith("  nearest 6.40 m at -90 degrees, median ")
    assert "-o FILE.json" in last


def test_terminal_gets_the_numbers_in_the_format_that_is_asked_for() -> None:
    asked = ("scan", "empty_room", "--sensor", "laser", *START, "--format", "csv")
    assert "scan,beam,angle,range,ray" in on_terminal(*asked)


def test_picture_is_written_to_a_pipe() -> None:
    run = scan("empty_room", "hokuyo", "--format", "png", "--count", "2")
    assert run.out.startswith(b"\x89PNG")
