import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.presets.materials import library_material
from radarsim.presets.particles import cover, grain_absorption, grain_extinction

SOIL = 4.5 - 0.25j, 2.65  # permittivity, g/cm^3
BANDS = (24, 77, 94)


@pytest.mark.parametrize(
    ("f_ghz", "bound"),
    [pytest.param(94, 0.02, id="94 GHz"), pytest.param(217, 0.08, id="217 GHz")],
)
def test_a_metre_of_dust_takes_less_than_was_measurable(
    f_ghz: float, bound: float
) -> None:
    assert 3 * grain_absorption(f_ghz, *SOIL) < bound
    assert max(library_material("dust", g_per_m3=3).radar_db) < 0.02


def test_dust_of_the_library_is_that_of_soil() -> None:
    law = [grain_absorption(band, *SOIL) for band in BANDS]
    told = library_material("dust", g_per_m3=1)
    assert told.radar_db == pytest.approx(law, rel=0.01)
    assert told.laser_db == pytest.approx(
        cover(grain_extinction(15e-6, 2.65)), rel=0.01
    )


def test_light_in_smoke_is_taken_in_inverse_proportion_to_its_wavelength() -> None:
    told = library_material("smoke", g_per_m3=1)
    assert told.laser_db == pytest.approx(cover(7.6 * 633 / 905), rel=0.01)


@pytest.mark.parametrize("name", ["smoke", "dust", "fog"])
def test_light_loses_a_hundred_times_what_a_radar_does(name: str) -> None:
    told = library_material(name)
    assert told.laser_db > 100 * max(told.radar_db)


@given(st.floats(0, 100), st.sampled_from(["smoke", "dust", "fog"]))
def test_losses_are_proportional_to_the_amount(amount: float, name: str) -> None:
    one, told = (library_material(name, g_per_m3=g) for g in (1.0, amount))
    assert told.laser_db == pytest.approx(amount * one.laser_db)
    assert told.radar_db == pytest.approx([amount * db for db in one.radar_db])


@given(st.floats(1e-6, 1e-3), st.floats(0.5, 5))
def test_grains_cover_twice_their_discs(diameter: float, g_per_cm3: float) -> None:
    grammes = g_per_cm3 * 1e6 * math.pi / 6 * diameter**3
    disc = math.pi / 4 * diameter**2
    told = grain_extinction(diameter, g_per_cm3)
    assert told == pytest.approx(2 * disc / grammes)
