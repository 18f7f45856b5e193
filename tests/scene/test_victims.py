"""Victims, tags and crates in map files."""

import math
from pathlib import Path

import pytest

from radarsim.errors import MapError
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Crate, Tag, Victim

MAP = """\
version: 1
objects:
  - {name: floor, box: [20, 12, 0.2], position: [0, 0, -0.1], material: concrete}
starts:
  - {name: RobotStart1, position: [-8, 0, 0]}
"""
BOTH = """\
tags:
  - {id: 11137, position: [1, 2, 0.5]}
victims:
  - {name: Becky, position: [4, 1, 0.1], yaw_deg: 180, moves: true,
     sound_db: 60, sound_s: 2, co2_percent: 4}
  - {name: Ann, position: [4, 3, 0.1]}
crates:
  - {name: Box, size: [1, 2, 0.5], position: [-4, 1, 0.25], yaw_deg: 30}
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "room.yaml"
    path.write_text(MAP + text)
    return path


def test_map_has_victims_and_tags_and_writes_them_again(tmp_path: Path) -> None:
    scene = load_map(written(tmp_path, BOTH))
    assert scene.tags == (Tag(11137, (1, 2, 0.5)),)
    becky, ann = scene.victims
    assert becky == Victim("Becky", (4, 1, 0.1), becky.yaw, True, 60, 2, 4)
    assert becky.head == pytest.approx((3.25, 1, 0.1))
    assert ann == Victim("Ann", (4, 3, 0.1))
    scene.to_yaml(tmp_path / "again.yaml")
    again = load_map(tmp_path / "again.yaml")
    assert (again.tags, again.victims) == (scene.tags, scene.victims)
    assert scene.crates == (Crate("Box", (1, 2, 0.5), (-4, 1, 0.25), math.pi / 6),)
    assert again.crates == scene.crates


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("tags: [{id: -1, position: [0, 0, 0]}]", r"tags.0.id: "),
        ("tags: [{id: 1, position: [0, 0, 0]}, {id: 1, position: [1, 0, 0]}]", "'1'"),
        (
            "victims: [{name: A, position: [0, 0, 0]}, {name: a, position: [1, 0, 0]}]",
            "'a'",
        ),
        ("victims: [{name: A, position: [0, 0, 0], sound: 3}]", "sound_db"),
        ("victims: {name: A}", "victims"),
        (
            "crates: [{name: A, size: [1, 1, 99], position: [0, 0, 0]}]",
            r"crates.0.size.2: ",
        ),
        (
            "crates: [{name: A, size: [1, 1, 1], position: [0, 0, 0]},"
            " {name: a, size: [1, 1, 1], position: [2, 0, 0]}]",
            "'a'",
        ),
    ],
)
def test_wrong_entries_are_reported_with_their_place(
    tmp_path: Path, text: str, message: str
) -> None:
    with pytest.raises(MapError, match=message):
        load_map(written(tmp_path, text))
