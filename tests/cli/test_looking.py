import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Command = Callable[..., Any]

WRONG = """\
version: 1
materials:
  leaf: {density: -1}
objects:
  - {name: bush, sphere: 1.0, position: [0, 0, 0], material: laef}
starts: []
"""


def test_check_tells_what_is_in_a_map(radarsim: Command) -> None:
    run = radarsim("check", "foliage_room")
    assert run.code == 0
    for text in ("16 objects", "foliage: density 0.7", "bush_7", "RobotStart1"):
        assert text in run.text
    assert run.err == ""


def test_check_tells_every_error_with_its_place(
    radarsim: Command, tmp_path: Path
) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(WRONG)
    run = radarsim("check", str(path))
    assert run.code == 1
    lines = run.text.splitlines()
    assert any(line.startswith(f"{path}:3:") and "density" in line for line in lines)
    assert any(line.startswith(f"{path}:5:") and "material" in line for line in lines)


@pytest.mark.parametrize("command", ["check", "scan", "serve"])
def test_a_map_that_is_not_there_is_one_line(radarsim: Command, command: str) -> None:
    options = ["--sensor", "radar", "--pose", "0,0,0"] if command == "scan" else []
    run = radarsim(command, "no_such_room", *options)
    assert run.code == 1
    assert "no_such_room" in run.text + run.err
    assert "Traceback" not in run.err


def test_sensors_are_listed_with_sources_and_confidence(radarsim: Command) -> None:
    run = radarsim("sensors")
    assert run.code == 0
    for text in ("radar", "hokuyo", "sick", "laser", "verified", "source"):
        assert text in run.text


def test_sensors_begin_with_a_line_for_each(radarsim: Command) -> None:
    lines = radarsim("sensors").text.splitlines()
    names = list(json.loads(radarsim("sensors", "--json").text))
    overview = lines[: lines.index("")]
    assert [line.split()[0] for line in overview if line[:1].strip()][1:] == names
    row = next(line for line in overview if line.startswith("thesis "))
    assert row.split()[:6] == ["thesis", "radar", "360", "359", "1", "80"]
    assert any(line.startswith("hokuyo: ") for line in lines[len(overview) :])


def test_sensors_by_name_are_those_alone(radarsim: Command) -> None:
    lines = radarsim("sensors", "sick", "k2pi").text.splitlines()
    assert lines[0].startswith("sick: ")
    assert sum(line.startswith(("sick: ", "k2pi: ")) for line in lines) == 2
    assert not any(line.startswith(("radar: ", "name ")) for line in lines)


def test_an_unknown_sensor_is_a_usage_error_that_names_those_there_are(
    radarsim: Command,
) -> None:
    run = radarsim("sensors", "radar", "rader")
    assert run.code == 2
    assert run.out == b""
    for text in ("'rader', expected one of", "'k2pi'", "'thesis'"):
        assert text in run.err


def test_sensors_for_programs(radarsim: Command) -> None:
    told = json.loads(radarsim("sensors", "--json").text)
    assert told["radar"]["settings"]["side_offset_uu"]["value"] == 25
    assert told["sick"]["settings"]["penetration_power"]["value"] is None


def test_sensors_by_name_for_programs(radarsim: Command) -> None:
    every = json.loads(radarsim("sensors", "--json").text)
    told = json.loads(radarsim("sensors", "laser", "thesis", "--json").text)
    assert told == {name: every[name] for name in ("laser", "thesis")}


def test_version_and_help(radarsim: Command) -> None:
    assert radarsim("--version").text.startswith("radarsim 0.")
    assert "serve" in radarsim("--help").text
    assert radarsim("sarve").code == 2


TAKEN = """\
version: 1
materials:
  wall: {density: opaque}
objects:
  - {name: wall, box: [0.2, 4, 2], position: [0, 0, 1], material: wall}
  - {name: fence, box: [30, 30, 2], position: [0, 0, 1], material: wall,
     repeat: {count: 1, step: [0, 0, 0]}}
starts:
  - {name: RobotStart1, position: [5, 5, 0]}
  - {name: RobotStart2, position: [0, 0, 0]}
  - {name: RobotStart3, position: [5, 5, 0]}
"""


def test_check_tells_which_starts_are_taken(radarsim: Command, tmp_path: Path) -> None:
    path = tmp_path / "taken.yaml"
    path.write_text(TAKEN)
    lines = radarsim("check", str(path)).text.splitlines()
    at = lines.index("starts that are not free")
    assert len(lines) == at + 2
    assert lines[at + 1].startswith("  RobotStart2: taken; a P3AT would stand at x ")
