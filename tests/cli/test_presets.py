"""What there is: sensors, robots and materials, with their numbers' sources."""

import json
import os
import subprocess
import sys
from collections.abc import Sequence

import pytest
from commands import run_in_process as radarsim

from radarsim.presets.robots import robot_names
from radarsim.presets.sensors import sensor_presets
from radarsim.scene.material import library_names

HUMMER = ("Ackermann", "4.57 x 2.16 x 2.1", "GPS, RangeScanner", "HMMWV")


@pytest.mark.parametrize(
    ("command", "names", "rows"),
    [
        (
            *("sensors", [*sensor_presets(), *sensor_presets("items")]),
            {"thesis": ["thesis radar 360 359 1 80"]},
        ),
        ("robots", robot_names(), {"Hummer": HUMMER, "Talon": ["skid"]}),
        (
            "materials",
            library_names(),
            {
                "foliage": ["foliage 2.37 3.31 3.5 opaque"],
                "glass": ["glass mirror mirror mirror 76"],
                "rain": ["25 mm/h"],
            },
        ),
    ],
)
def test_overview_of_all_comes_before_the_details_of_each(
    command: str, names: Sequence[str], rows: dict[str, Sequence[str]]
) -> None:
    lines = radarsim(command).text.splitlines()
    overview = [line.split() for line in lines[: lines.index("")] if line[0] != " "]
    printed = {words[0]: " ".join(words) for words in overview[1:]}
    assert list(printed) == list(names)
    for name, texts in rows.items():
        assert all(text in printed[name] for text in texts)
    details = [line.partition(": ")[0] for line in lines[len(overview) + 1 :]]
    assert set(names) <= set(details)


@pytest.mark.parametrize(
    ("command", "names", "texts"),
    [
        ("sensors", ("sick", "k2pi"), ["\nk2pi: ", "verified", "source"]),
        (
            *("robots", ("Kenaf", "FrontAckerman")),
            ["Kenaf.uc", "verified", "max_front_deg 28.6", "Hokuyo"],
        ),
        (
            *("materials", ("wood", "fog")),
            ["P.2040-3", "verified", "fog: ", "P.840", "estimate"],
        ),
    ],
)
def test_named_ones_are_listed_alone_with_their_sources(
    command: str, names: tuple[str, ...], texts: list[str]
) -> None:
    text = radarsim(command, *names).text
    assert text.startswith(f"{names[0]}: ")
    assert all(each in text for each in texts)
    heads = {line.partition(": ")[0] for line in text.splitlines()}
    assert heads & {*json.loads(radarsim(command, "--json").text)} == {*names}


@pytest.mark.parametrize(
    ("command", "names", "place", "value"),
    [
        ("sensors", ("thesis", "sick"), "sick settings penetration_power value", None),
        ("sensors", ("radar",), "radar settings side_offset_uu value", 25),
        ("robots", ("Sedan", "P3AT"), "Sedan steering max_front_deg", 33),
        ("materials", ("rain", "twigs"), "twigs numbers db_per_m value 77", 0.99),
        ("materials", ("rain",), "rain numbers mm_per_h confidence", "choice"),
    ],
)
def test_json_has_all_or_those_that_are_named(
    command: str, names: tuple[str, ...], place: str, value: object
) -> None:
    every = json.loads(radarsim(command, "--json").text)
    found = json.loads(radarsim(command, *names, "--json").text)
    assert list(found.items()) == [(name, every[name]) for name in names]
    for key in place.split():
        found = found[key]
    assert found == value


def test_rows_into_a_pipe_are_not_cut_into_lines() -> None:
    known = {k: v for k, v in os.environ.items() if k != "COLUMNS"}
    words = (sys.executable, "-m", "radarsim", "materials", "brick", "atmosphere")
    shown = subprocess.run(words, env=known, capture_output=True, text=True, check=True)
    assert max(map(len, shown.stdout.splitlines())) > 120
