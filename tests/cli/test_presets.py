import json
import os
import subprocess
import sys
from collections.abc import Callable
from typing import Any

from radarsim.presets.robots import robot_names
from radarsim.scene.material import library_names

Command = Callable[..., Any]


def test_sensors_are_listed_with_sources_and_confidence(radarsim: Command) -> None:
    run = radarsim("sensors")
    assert run.code == 0
    for text in ("radar", "hokuyo", "sick", "laser", "verified", "source"):
        assert text in run.text


def test_sensors_start_with_an_overview(radarsim: Command) -> None:
    lines = radarsim("sensors").text.splitlines()
    names = list(json.loads(radarsim("sensors", "--json").text))
    overview = lines[: lines.index("")]
    assert [line.split()[0] for line in overview if line[:1].strip()][1:] == names
    row = next(line for line in overview if line.startswith("thesis "))
    assert row.split()[:6] == ["thesis", "radar", "360", "359", "1", "80"]
    assert any(line.startswith("hokuyo: ") for line in lines[len(overview) :])


def test_named_sensors_are_listed_alone(radarsim: Command) -> None:
    lines = radarsim("sensors", "sick", "k2pi").text.splitlines()
    assert lines[0].startswith("sick: ")
    assert sum(line.startswith("k2pi: ") for line in lines) == 2
    assert not any(line.startswith(("radar: ", "name ")) for line in lines)


def test_sensors_as_json(radarsim: Command) -> None:
    told = json.loads(radarsim("sensors", "--json").text)
    assert told["radar"]["settings"]["side_offset_uu"]["value"] == 25
    assert told["sick"]["settings"]["penetration_power"]["value"] is None


def test_named_sensors_as_json(radarsim: Command) -> None:
    every = json.loads(radarsim("sensors", "--json").text)
    told = json.loads(radarsim("sensors", "laser", "thesis", "--json").text)
    assert told == {name: every[name] for name in ("laser", "thesis")}


def test_robots_start_with_an_overview_of_their_items(radarsim: Command) -> None:
    lines = radarsim("robots").text.splitlines()
    overview = lines[: lines.index("")]
    rows = {line.split()[0]: line for line in overview}
    assert list(rows)[1:] == list(robot_names())
    for words in ("Ackermann", "4.57 x 2.16 x 2.1", "GPS, RangeScanner", "HMMWV"):
        assert words in rows["Hummer"]
    assert "skid" in rows["Talon"]


def test_named_robots_are_listed_alone_with_their_sources(radarsim: Command) -> None:
    text = radarsim("robots", "Kenaf", "FrontAckerman").text
    assert text.startswith("Kenaf: ")
    for words in ("Kenaf.uc", "verified", "max_front_deg 28.6", "Hokuyo"):
        assert words in text


def test_robots_as_json(radarsim: Command) -> None:
    told = json.loads(radarsim("robots", "Sedan", "P3AT", "--json").text)
    assert told["Sedan"]["steering"]["max_front_deg"] == 33
    assert told["P3AT"]["items"][-1]["name"] == "lms200"


def test_materials_start_with_an_overview(radarsim: Command) -> None:
    lines = radarsim("materials").text.splitlines()
    overview = lines[: lines.index("")]
    rows = {line.split()[0]: line.split() for line in overview if line[:1].strip()}
    assert list(rows)[1:] == list(library_names())
    assert rows["foliage"][1:5] == ["2.37", "3.31", "3.5", "opaque"]
    assert rows["glass"][1:5] == ["mirror", "mirror", "mirror", "76"]
    assert rows["rain"][5:7] == ["25", "mm/h"]


def test_named_materials_are_listed_alone_with_their_sources(
    radarsim: Command,
) -> None:
    text = radarsim("materials", "wood", "fog").text
    assert text.startswith("wood: ")
    for words in ("P.2040-3", "verified", "fog: ", "P.840", "estimate"):
        assert words in text
    assert "smoke" not in text


def test_materials_as_json(radarsim: Command) -> None:
    told = json.loads(radarsim("materials", "twigs", "rain", "--json").text)
    assert list(told) == ["twigs", "rain"]
    assert told["twigs"]["numbers"]["db_per_m"]["value"]["77"] == 0.99
    assert told["rain"]["numbers"]["mm_per_h"]["confidence"] == "choice"
    every = json.loads(radarsim("materials", "--json").text)
    assert list(every) == list(library_names())


def test_rows_into_a_pipe_are_not_cut_into_lines() -> None:
    known = {k: v for k, v in os.environ.items() if k != "COLUMNS"}
    words = (sys.executable, "-m", "radarsim", "materials", "brick", "atmosphere")
    shown = subprocess.run(words, env=known, capture_output=True, text=True, check=True)
    assert max(map(len, shown.stdout.splitlines())) > 120
