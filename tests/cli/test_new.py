"""The starter map that ``radarsim new`` writes."""

import json
from pathlib import Path

import pytest
from commands import run_in_process as radarsim


@pytest.fixture
def room(tmp_path: Path) -> Path:
    path = tmp_path / "my room.yaml"
    run = radarsim("new", path)
    assert f"radarsim serve '{path}'" in run.text
    return path


def test_starter_map_passes_the_strict_check(room: Path) -> None:
    run = radarsim("check", room, "--strict")
    assert run.code == 0
    for text in ("hedge", "bush", "crate", "RobotStart1", "trial", "@dust"):
        assert text in run.text


def test_radar_sees_through_the_hedge_that_stops_the_laser(room: Path) -> None:
    ahead = {}
    for sensor in ("radar", "sick"):
        words = ("--sensor", sensor, "--start", "RobotStart1")
        scan = json.loads(radarsim("scan", room, *words).text)
        ahead[sensor] = scan["ranges"][len(scan["ranges"]) // 2]
    assert ahead["sick"] < 4.5 < ahead["radar"]


def test_existing_file_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "room.yaml"
    path.write_text("mine")
    run = radarsim("new", path)
    assert run.code == 2
    assert "exists, expected the name of a new file" in run.err
    assert path.read_text() == "mine"


def test_random_map_is_written_by_its_number(tmp_path: Path) -> None:
    path = tmp_path / "yard.yaml"
    assert radarsim("new", path, "--random", "4").code == 0
    assert "family 'mazes'" in path.read_text()
    assert radarsim("check", path, "--strict").code == 0
