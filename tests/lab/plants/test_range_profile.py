"""Ranges of plants that are simple enough to be computed by hand."""

from dataclasses import replace

import numpy as np
import pytest

from radarsim.generators.plants.species import SHRUB
from radarsim.lab.plants import BEFORE, HEIGHT, WALL, measure_plant
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.scene.shapes import cylinder

FORM = replace(SHRUB, crown_centre=HEIGHT)  # rays go through its middle


def column(radius: float, density: float) -> list[Part]:
    vertices, faces = cylinder(radius, 4.0)
    return [Part("column", Material("foliage", density=density), vertices, faces)]


def test_without_a_plant_all_ranges_are_those_of_the_wall() -> None:
    measured = measure_plant(FORM, [], offsets=11, azimuths=4)
    assert (measured.ranges == WALL).all()
    statistics = measured.statistics()
    assert (statistics.mean, statistics.deviation, statistics.spent) == (WALL, 0, 0)
    assert statistics.through == 1


def test_rays_pass_over_the_width_of_the_crown_at_the_height_of_the_scanner() -> None:
    measured = measure_plant(SHRUB, [], offsets=101, azimuths=4)
    width = np.sqrt(1 - (SHRUB.crown_centre - HEIGHT) ** 2)
    assert measured.offsets[[0, -1]] == pytest.approx([-width, width], rel=0.03)
    assert measure_plant(FORM, [], azimuths=4).offsets[-1] == pytest.approx(1, rel=0.03)


def test_range_ends_where_the_power_is_spent() -> None:
    measured = measure_plant(FORM, column(0.8, 1.0), offsets=101, azimuths=12)
    chords = 2 * np.sqrt(np.maximum(0.64 - measured.offsets**2, 0))
    wanted = np.where(chords > 1, BEFORE - chords / 2 + 1, WALL)
    sure = np.abs(chords - 1) > 0.02  # the column has 64 sides
    error = np.abs(measured.ranges - wanted)[:, sure]
    assert error.max() < 5e-3
    assert (measured.spent == (measured.ranges < WALL)).all()


def test_plant_that_looks_the_same_from_all_sides_has_no_deviation_at_one_offset() -> (
    None
):
    parts = column(0.8, 1.0)
    statistics = measure_plant(FORM, parts, offsets=50, azimuths=16).statistics()
    assert statistics.at_one_offset < 1e-9
    assert statistics.deviation > 1
    assert statistics.through == pytest.approx(1 - np.sqrt(0.64 - 0.25), abs=0.03)
    low, middle, high = statistics.percentiles
    assert low < BEFORE + 0.3 < high == WALL
    assert low <= middle <= high


def test_wood_is_measured_but_no_power_is_spent_in_it() -> None:
    vertices, faces = cylinder(0.5, 4.0)
    parts = [Part("trunk", Material("wood"), vertices, faces)]
    measured = measure_plant(FORM, parts, offsets=11, azimuths=4)
    assert not measured.spent.any()
    assert measured.statistics().spent == 0
    assert measured.ranges.min() == pytest.approx(BEFORE - 0.5)
