import re
from pathlib import Path

import numpy as np
import pytest

from radarsim.lab.bench.robots import (
    POLES,
    ROBOTS_IN_A_ROW,
    drive_line,
    init_line,
    write_hall,
)
from radarsim.scene.map_file import load_map

PLACES = ROBOTS_IN_A_ROW**2


def places() -> np.ndarray:
    lines = [init_line(number).decode() for number in range(PLACES)]
    found = [re.search(r"\{Location (\S+),(\S+),0\}", line) for line in lines]
    return np.array([match.groups() for match in found if match], np.float64)


def test_each_of_a_thousand_robots_has_a_place_of_its_own() -> None:
    assert PLACES > 1024
    assert len(np.unique(places(), axis=0)) == PLACES
    assert np.abs(places()).max() < 44


def test_robots_stand_away_from_poles(tmp_path: Path) -> None:
    scene = load_map(write_hall(tmp_path))
    poles = [part for part in scene.parts if part.object_name.startswith("pole")]
    assert len(poles) == POLES**2 == 121
    at = np.array([part.vertices[:, :2].mean(axis=0) for part in poles])
    apart = np.linalg.norm(places()[:, None] - at, axis=2)
    assert apart.min() > 1.5


def test_few_robots_are_spread_over_the_hall() -> None:
    quarters = {(x > 0, y > 0) for x, y in places()[:100].tolist()}
    assert len(quarters) == 4


def test_bare_hall_is_90_m_long_and_wide(tmp_path: Path) -> None:
    scene = load_map(write_hall(tmp_path, poles=0))
    inside = [part.vertices for part in scene.parts if part.object_name == "east"]
    assert inside[0][:, 0].min() == pytest.approx(45)
    assert len(scene.parts) == 5


def test_every_second_robot_turns_to_the_left() -> None:
    speeds = [re.findall(rb"(?:Left|Right) ([0-9.]+)", drive_line(i)) for i in (0, 1)]
    assert speeds[0] == speeds[1][::-1]
    assert speeds[0][0] != speeds[0][1]
