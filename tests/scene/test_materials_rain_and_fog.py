"""Rain and fog of the library, against published laws and tables."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles.particles import extinction_in_db, grain_extinction

from radarsim.scene.material import library_material, rain_attenuation

RATES = (1, 5, 12.5, 25, 50, 100)  # mm/h


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


def test_visibility_in_the_librarys_fog_is_300_m() -> None:
    per_metre = library_material("fog").laser_db / (10 / math.log(10))
    assert 3.912 / per_metre == pytest.approx(300, rel=0.05)  # Koschmieder
    drops = extinction_in_db(grain_extinction(12e-6, 1.0))
    assert library_material("fog", g_per_m3=1).laser_db == pytest.approx(
        drops, rel=0.02
    )
