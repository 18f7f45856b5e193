"""A town by its seed."""

import numpy as np
import pytest
from town_maps import GROUND, PAVEMENT, ROADWAY, SIDE, town_yaml

import radarsim
from radarsim.scene.scene import Scene


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    path = tmp_path_factory.mktemp("town") / "town.yaml"
    path.write_text(town_yaml(1))
    return radarsim.load_map(path)


def test_same_seed_gives_the_same_bytes() -> None:
    assert town_yaml(7) == town_yaml(7)
    assert town_yaml(7) != town_yaml(8)


def test_town_is_200_m_wide_and_has_what_a_suburb_has(town: Scene) -> None:
    low, high = town.bounds
    assert (high - low)[:2] == pytest.approx([SIDE, SIDE], abs=25)
    names = {part.object_name.split("_")[0] for part in town.parts}
    for name in ("wall", "window", "car", "crown", "hedge", "fence", "lamp", "road"):
        assert name in names
    assert 1500 < len(town.parts) < 6000


def test_facades_vary_from_bay_to_bay(town: Scene) -> None:
    walls = [part for part in town.parts if part.object_name.startswith("wall_")]
    kinds = {part.material for part in walls}
    levels = [kind.backscatter_db for kind in kinds]
    assert max(levels) - min(levels) > 6
    assert len({kind.slope_deg for kind in kinds}) > 3


def test_streets_are_free_and_starts_are_on_them(town: Scene) -> None:
    """Nothing that stands reaches into the lanes, which are 4 m wide in all."""
    first = town.starts[0].pose
    assert len(town.starts) > 20
    ground = {"ground", "road", "pavement", "repair", "patch", "car_park"}
    for part in town.parts:
        low, high = part.bounds
        if high[2] < 0.01 and part.material.name in GROUND:
            assert part.object_name.rsplit("_", 1)[0] in ground
            continue
        lane = (first.y - 0.9, first.y + 2.9)
        assert low[1] > lane[1] or high[1] < lane[0] or abs(low[0]) > SIDE / 2 - 8


def test_ground_of_street_and_gardens_differs(town: Scene) -> None:
    start = town.starts[0].pose
    middle = start.y + 1
    roads = [part for part in town.parts if part.object_name.startswith("road_")]
    across = [part for part in roads if part.bounds[0][1] < middle < part.bounds[1][1]]
    covered = sum(float(np.diff(part.bounds[:, 0])[0]) for part in across)
    assert covered >= SIDE
    assert ROADWAY < PAVEMENT
    assert len({part.material.name for part in across}) > 1
