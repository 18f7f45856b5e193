"""Ranges of plants that are simple enough to be known."""

from dataclasses import replace

import numpy as np
import pytest

from radarsim.plants.calibration import BEFORE, HEIGHT, WALL, read_plant
from radarsim.plants.growth import SHRUB
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.scene.shapes import cylinder

FORM = replace(SHRUB, crown_centre=HEIGHT)  # rays go through its middle


def column(radius: float, density: float) -> list[Part]:
    vertices, faces = cylinder(radius, 4.0)
    return [Part("column", Material("foliage", density=density), vertices, faces)]


def test_without_a_plant_every_ray_reads_the_wall() -> None:
    reading = read_plant(FORM, [], offsets=11, azimuths=4)
    assert (reading.ranges == WALL).all()
    spread = reading.spread()
    assert (spread.mean, spread.deviation, spread.spent) == (WALL, 0, 0)
    assert spread.through == 1


def test_rays_pass_over_the_width_of_the_crown_at_the_height_of_the_scanner() -> None:
    reading = read_plant(SHRUB, [], offsets=101, azimuths=4)
    width = np.sqrt(1 - (SHRUB.crown_centre - HEIGHT) ** 2)
    assert reading.offsets[[0, -1]] == pytest.approx([-width, width], rel=0.03)
    assert read_plant(FORM, [], azimuths=4).offsets[-1] == pytest.approx(1, rel=0.03)


def test_a_ray_is_spent_where_its_power_has_been_paid() -> None:
    reading = read_plant(FORM, column(0.8, 1.0), offsets=101, azimuths=12)
    chords = 2 * np.sqrt(np.maximum(0.64 - reading.offsets**2, 0))
    wanted = np.where(chords > 1, BEFORE - chords / 2 + 1, WALL)
    sure = np.abs(chords - 1) > 0.02  # the column has 64 sides
    error = np.abs(reading.ranges - wanted)[:, sure]
    assert error.max() < 5e-3
    assert (reading.spent == (reading.ranges < WALL)).all()


def test_what_looks_the_same_from_all_sides_has_no_spread_at_one_offset() -> None:
    parts = column(0.8, 1.0)
    spread = read_plant(FORM, parts, offsets=50, azimuths=16).spread()
    assert spread.at_one_offset < 1e-9
    assert spread.deviation > 1
    assert spread.through == pytest.approx(1 - np.sqrt(0.64 - 0.25), abs=0.03)
    low, middle, high = spread.percentiles
    assert low < BEFORE + 0.3 < high == WALL
    assert low <= middle <= high


def test_wood_is_read_but_nothing_is_spent_there() -> None:
    vertices, faces = cylinder(0.5, 4.0)
    parts = [Part("trunk", Material("wood"), vertices, faces)]
    reading = read_plant(FORM, parts, offsets=11, azimuths=4)
    assert not reading.spent.any()
    assert reading.spread().spent == 0
    assert reading.ranges.min() == pytest.approx(BEFORE - 0.5)
