"""The library's numbers against another implementation of ITU-R's recommendations."""

import warnings
from types import ModuleType

import pytest

from radarsim.scene.material import library_entry, library_material

BANDS = (24, 77, 94)


def _models() -> tuple[ModuleType, ModuleType, ModuleType]:
    with warnings.catch_warnings():  # from its imports
        warnings.simplefilter("ignore")
        from itur.models import itu676, itu838, itu840
    return itu676, itu838, itu840


GAS, RAIN, FOG = _models()


@pytest.mark.parametrize("band", BANDS)
def test_rain_law_of_the_library_is_that_of_p838(band: int) -> None:
    numbers = library_entry("rain").numbers
    loss = [numbers[key].value[str(band)] for key in ("rain_k", "rain_alpha")]
    law = RAIN.rain_specific_attenuation_coefficients(band, 0, 45)
    assert loss == pytest.approx([float(each) for each in law], rel=2e-5)


@pytest.mark.parametrize("rate", [0.25, 5, 25, 150])
def test_attenuation_in_rain_is_that_of_p838(rate: float) -> None:
    rain = library_material("rain", mm_per_h=rate)
    assert rain.rain == rate
    expected = [
        float(RAIN.rain_specific_attenuation(rate, band, 0, 45).value) / 1000
        for band in BANDS
    ]
    assert rain.radar_db == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(("band", "db"), [(24, 0.38534), (77, 3.14726), (94, 4.23755)])
def test_library_loss_of_one_gramme_of_fog_is_that_of_p840(
    band: int, db: float
) -> None:
    loss = library_material("fog", g_per_m3=1).radar_db[BANDS.index(band)]
    assert 1000 * loss == pytest.approx(db, abs=1e-3)
    published = float(FOG.specific_attenuation_coefficients(band, 10))
    assert published == pytest.approx(db, abs=1e-4)


@pytest.mark.parametrize(
    ("f_ghz", "db_per_km"),
    [
        (24, 0.17316114),
        (60, 14.77832),
        (77, 0.34804351),
        (94, 0.40812888),
        (95, 0.41569336),
    ],
)
def test_loss_in_clear_air_is_that_of_p676(f_ghz: float, db_per_km: float) -> None:
    """The values are those that ITU-R publishes to validate programs."""
    air = 1013.25, 7.5, 288.15  # hPa, g/m^3, K
    oxygen, vapour = (law(f_ghz, *air) for law in (GAS.gamma0_exact, GAS.gammaw_exact))
    assert (oxygen + vapour).value == pytest.approx(db_per_km, rel=1e-6)
    if f_ghz in BANDS:
        loss = library_material("atmosphere").radar_db[BANDS.index(int(f_ghz))]
        assert 1000 * loss == pytest.approx(db_per_km, rel=3e-5)
