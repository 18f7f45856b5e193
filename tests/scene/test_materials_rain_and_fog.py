"""Rain and fog of the library, against published laws and tables."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles.hydrometeors import (
    PowerLaw,
    fog_attenuation,
    polarised,
    rain_law_of_light,
)
from oracles.particles import extinction_in_db, grain_extinction

from radarsim.scene.material import library_entry, library_material, rain_attenuation

BANDS = (24, 77, 94)
RATES = (1, 5, 12.5, 25, 50, 100)  # mm/h
HORIZONTAL = {
    24: PowerLaw(0.142496, 1.010110),
    77: PowerLaw(1.131968, 0.717681),
    94: PowerLaw(1.317860, 0.688771),
}
VERTICAL = {
    24: PowerLaw(0.140440, 0.956086),
    77: PowerLaw(1.127619, 0.707295),
    94: PowerLaw(1.317504, 0.682845),
}


@pytest.mark.parametrize(
    ("k", "alpha", "db_per_km"),
    [
        pytest.param(0.03975488, 1.12418043, 1.58130839, id="14.25 GHz"),
        pytest.param(0.22106804, 0.95320005, 5.02180189, id="29 GHz"),
    ],
)
def test_attenuation_matches_the_validation_table_of_p838(
    k: float, alpha: float, db_per_km: float
) -> None:
    loss = 1000 * rain_attenuation(k, alpha, 26.48052)
    assert loss == pytest.approx(db_per_km, abs=1e-6)


def test_rain_of_the_library_is_between_horizontal_and_vertical_polarisation() -> None:
    numbers = library_entry("rain").numbers
    for place, band in enumerate(BANDS):
        law = polarised(HORIZONTAL[band], VERTICAL[band], math.pi / 4)
        k, alpha = (numbers[key].value[str(band)] for key in ("rain_k", "rain_alpha"))
        assert (k, alpha) == pytest.approx(law, rel=1e-5)
        for rate in RATES:
            loss = library_material("rain", mm_per_h=rate)
            ends = [
                rain_attenuation(*laws[band], rate) for laws in (HORIZONTAL, VERTICAL)
            ]
            assert min(ends) - 1e-9 <= loss.radar_db[place] <= max(ends) + 1e-9
            assert loss.rain == rate


@pytest.mark.parametrize(
    ("efficiency", "db_per_km"),
    [
        pytest.param(2, (1.6, 4.4, 7.8, 12.0, 18.6, 28.8), id="with diffraction"),
        pytest.param(1, (0.8, 2.2, 3.9, 6.0, 9.3, 14.4), id="without diffraction"),
    ],
)
def test_attenuation_of_light_in_rain(
    efficiency: float, db_per_km: tuple[float, ...]
) -> None:
    law = rain_law_of_light(efficiency)
    loss = [1000 * rain_attenuation(*law, rate) for rate in RATES]
    assert loss == pytest.approx(db_per_km, abs=0.05)


def test_light_loses_the_area_of_marshall_and_palmers_drops() -> None:
    step = 1e-3  # mm
    sizes = [step * (i + 0.5) for i in range(20_000)]
    for rate in RATES:
        slope = 4.1 * rate**-0.21
        area = math.fsum(math.pi / 4 * d**2 * math.exp(-slope * d) for d in sizes)
        expected = 10 / math.log(10) * 8000 * 1e-6 * step * area
        loss = library_material("rain", mm_per_h=rate).laser_db
        assert loss == pytest.approx(expected, rel=1e-3)


@given(st.floats(0, 150), st.floats(0, 150))
def test_loss_grows_with_the_rain_rate(one: float, other: float) -> None:
    low, high = (library_material("rain", mm_per_h=r) for r in sorted((one, other)))
    assert all(a <= b for a, b in zip(low.radar_db, high.radar_db, strict=True))
    assert low.laser_db <= high.laser_db


def test_rain_of_0_mm_per_h_has_no_effect() -> None:
    dry = library_material("rain", mm_per_h=0)
    assert (dry.radar_db, dry.laser_db, dry.rain) == ((0, 0, 0), 0, 0)


@pytest.mark.parametrize(
    ("celsius", "db_per_km"),
    [
        pytest.param(0, (0.5086, 2.485, 3.537, 4.546), id="0 C"),
        pytest.param(10, (0.3853, 2.096, 3.147, 4.238), id="10 C"),
        pytest.param(20, (0.3035, 1.746, 2.713, 3.780), id="20 C"),
    ],
)
def test_attenuation_in_fog_at_24_60_77_and_94_ghz(
    celsius: float, db_per_km: tuple[float, ...]
) -> None:
    loss = [1000 * fog_attenuation(f, celsius) for f in (24, 60, 77, 94)]
    assert loss == pytest.approx(db_per_km, rel=1e-3)


def test_fog_of_the_library_is_that_at_10_degrees_celsius() -> None:
    law = [0.5 * fog_attenuation(band, 10) for band in BANDS]
    assert library_material("fog", g_per_m3=0.5).radar_db == pytest.approx(
        law, rel=1e-3
    )


def test_visibility_in_the_librarys_fog_is_300_m() -> None:
    per_metre = library_material("fog").laser_db / (10 / math.log(10))
    assert 3.912 / per_metre == pytest.approx(300, rel=0.05)  # Koschmieder
    drops = extinction_in_db(grain_extinction(12e-6, 1.0))
    assert library_material("fog", g_per_m3=1).laser_db == pytest.approx(
        drops, rel=0.02
    )
