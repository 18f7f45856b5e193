"""Boards and mirrors of the library, against Fresnel's equations and ITU-R P.2040."""

import cmath
import math

import pytest
from oracles.permittivity import P2040, bulk_loss, permittivity, reflectance

from radarsim.scene.material import library_entry, library_material

BANDS = (24, 77, 94)


@pytest.mark.parametrize(
    ("name", "shares", "losses"),
    [
        pytest.param("concrete", (0.1545, 0.1542, 0.1541), (396, 987, 1154)),
        pytest.param("brick", (0.1078, 0.1078, 0.1078), (33, 39, 41)),
        pytest.param("plasterboard", (0.0607, 0.0607, 0.0607), (167, 498, 601)),
        pytest.param("wood", (0.0294, 0.0294, 0.0294), (164, 573, 710)),
        pytest.param("glass", (0.1855, 0.1856, 0.1857), (166, 789, 1030)),
        pytest.param("chipboard", (0.0548, 0.0545, 0.0545), (264, 654, 765)),
    ],
)
def test_reflectance_and_loss_of_building_materials(
    name: str, shares: tuple[float, ...], losses: tuple[float, ...]
) -> None:
    media = [permittivity(P2040[name], band) for band in BANDS]
    assert [reflectance(medium) for medium in media] == pytest.approx(shares, abs=1e-3)
    taken = [bulk_loss(m, band) for m, band in zip(media, BANDS, strict=True)]
    assert taken == pytest.approx(losses, abs=0.6)


@pytest.mark.parametrize(("band", "share"), [(24, 0.999), (77, 0.9982), (94, 0.998)])
def test_metal_reflects_nearly_all_power(band: int, share: float) -> None:
    metal = permittivity(P2040["metal"], band)
    assert reflectance(metal) == pytest.approx(share, abs=1e-4)
    assert bulk_loss(metal, band) > 1e6


@pytest.mark.parametrize(
    ("name", "thickness", "passed"),
    [
        ("plasterboard", 0.0125, (-2.8, -6.9, -8.0)),
        pytest.param("wood", 0.03, (-5.2, -17.5, -21.6), id="wood"),
        ("chipboard", 0.018, (-5.3, -12.2, -14.2)),
    ],
)
def test_boards_transmit_nearly_what_a_slab_with_internal_reflections_does(
    name: str, thickness: float, passed: tuple[float, ...]
) -> None:
    for band, db, inside in zip(
        BANDS, passed, library_material(name).radar_db, strict=True
    ):
        index = cmath.sqrt(permittivity(P2040[name], band))
        turn = index * 2 * math.pi * band * 1e9 / 299792458 * thickness
        half = (1 - index) / (1 + index)
        whole = (1 - half**2) * cmath.exp(-1j * turn)
        whole /= 1 - half**2 * cmath.exp(-2j * turn)
        assert 20 * math.log10(abs(whole)) == pytest.approx(db, abs=0.06)
        assert -inside * thickness == pytest.approx(db, abs=1.3)  # without the faces


@pytest.mark.parametrize("name", ["wood", "plasterboard", "chipboard"])
def test_boards_of_the_library_have_the_loss_of_p2040(name: str) -> None:
    law = [bulk_loss(permittivity(P2040[name], band), band) for band in BANDS]
    assert library_material(name).radar_db == pytest.approx(law, abs=0.6)


def test_mirrors_of_the_library_absorb_what_p2040_says() -> None:
    for name in ("glass", "metal"):
        absorbed = library_entry(name).numbers["absorption_db"].value
        for band in BANDS:
            share = reflectance(permittivity(P2040[name], band))
            assert -10 * math.log10(share) == pytest.approx(absorbed, abs=0.02)
