"""Smoke and dust of the library, against scattering by small particles."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles.particles import extinction_in_db, grain_absorption, grain_extinction

from radarsim.scene.material import library_material

SOIL = 4.5 - 0.25j, 2.65  # permittivity, g/cm^3
BANDS = (24, 77, 94)


@pytest.mark.parametrize(
    ("f_ghz", "bound"),
    [pytest.param(94, 0.02, id="94 GHz"), pytest.param(217, 0.08, id="217 GHz")],
)
def test_loss_in_dust_is_below_the_measurable_bound(f_ghz: float, bound: float) -> None:
    assert 3 * grain_absorption(f_ghz, *SOIL) < bound
    assert max(library_material("dust", g_per_m3=3).radar_db) < 0.02


def test_dust_of_the_library_has_the_loss_of_soil() -> None:
    law = [grain_absorption(band, *SOIL) for band in BANDS]
    material = library_material("dust", g_per_m3=1)
    assert material.radar_db == pytest.approx(law, rel=0.01)
    assert material.laser_db == pytest.approx(
        extinction_in_db(grain_extinction(15e-6, 2.65)), rel=0.01
    )


def test_loss_of_light_in_smoke_is_inversely_proportional_to_wavelength() -> None:
    material = library_material("smoke", g_per_m3=1)
    assert material.laser_db == pytest.approx(
        extinction_in_db(7.6 * 633 / 905), rel=0.01
    )


# dB/m of one gramme in a cubic metre at 24, 77 and 94 GHz: soot by Mie's theory; dust
# as above; fog by ITU-R P.840 at 10 degrees C. One way.
@pytest.mark.parametrize(
    ("name", "wanted", "light"),
    [
        ("smoke", (4.0e-4, 1.2e-3, 1.5e-3), 23.0),
        ("dust", (4.4e-5, 1.41e-4, 1.72e-4), 0.33),
        ("fog", (3.853e-4, 3.147e-3, 4.238e-3), 1.1),
    ],
)
def test_loss_of_radar_waves_and_of_light_has_its_value(
    name: str, wanted: tuple[float, float, float], light: float
) -> None:
    material = library_material(name, g_per_m3=1)
    assert material.radar_db == pytest.approx(wanted, rel=1e-3)
    assert material.laser_db == pytest.approx(light, rel=1e-3)


def test_soot_absorbs_radar_waves_in_proportion_to_their_frequency() -> None:
    # Rayleigh's law for grains of 1.8 g/cm^3: the rest is Im((e - 1) / (e + 2)),
    # which has hardly another value at one band than at another
    bands = zip(BANDS, library_material("smoke", g_per_m3=1).radar_db, strict=True)
    left = [
        db * (0.299792458 / f_ghz) * 1.8e6 / (6 * math.pi * 10 / math.log(10))
        for f_ghz, db in bands
    ]
    assert left == pytest.approx([0.106] * 3, rel=0.05)


@given(st.floats(0, 100), st.sampled_from(["smoke", "dust", "fog"]))
def test_loss_is_proportional_to_the_amount(amount: float, name: str) -> None:
    one, several = (library_material(name, g_per_m3=g) for g in (1.0, amount))
    assert several.laser_db == pytest.approx(amount * one.laser_db)
    assert several.radar_db == pytest.approx([amount * db for db in one.radar_db])


@given(st.floats(1e-6, 1e-3), st.floats(0.5, 5))
def test_grains_extinguish_twice_the_area_of_their_discs(
    diameter: float, g_per_cm3: float
) -> None:
    grammes = g_per_cm3 * 1e6 * math.pi / 6 * diameter**3
    disc = math.pi / 4 * diameter**2
    assert grain_extinction(diameter, g_per_cm3) == pytest.approx(2 * disc / grammes)
