"""Vegetation of the library, against published one-way losses at 28.8 to 80 GHz."""

import pytest
from oracles.vegetation import convert_band, p833, p833_most, weissberger

from radarsim.scene.material import library_material


@pytest.mark.parametrize(
    ("f_ghz", "depth", "db"),
    [
        pytest.param(0.9, 100, 19.36, id="100 m at 0.9 GHz"),
        pytest.param(24, 1, 1.11, id="1 m at 24 GHz"),
        pytest.param(94, 10, 16.4, id="10 m at 94 GHz"),
    ],
)
def test_weissbergers_law_matches_published_values(
    f_ghz: float, depth: float, db: float
) -> None:
    assert weissberger(f_ghz, depth) == pytest.approx(db, abs=0.05)


@pytest.mark.parametrize(
    ("name", "at_ghz", "measured"),
    [
        ("sparse_foliage", 73, (0.4, 0.4)),
        pytest.param("twigs", 28.8, (0.75, 0.75), id="bare pecan"),
        pytest.param("foliage", 28.8, (2.5, 2.5), id="leafy pecan"),
        ("woodland", 28.8, (1.3, 2.0)),
        ("woodland", 57.6, (1.3, 2.0)),
        pytest.param("foliage", 38, (2.0, 4.0), id="dry leaves"),
        ("wet_foliage", 38, (6.0, 8.0)),
    ],
)
def test_library_is_within_50_percent_of_measurements(
    name: str, at_ghz: float, measured: tuple[float, float]
) -> None:
    for band, db in zip((24, 77, 94), library_material(name).radar_db, strict=True):
        converted = convert_band(db, band, at_ghz)
        assert 0.5 * measured[0] <= converted <= 1.5 * measured[1]


def test_leaves_add_the_loss_measured_at_80_ghz() -> None:
    leafy, bare = (library_material(name) for name in ("foliage", "twigs"))
    more = convert_band(leafy.radar_db[1] - bare.radar_db[1], 77, 80)
    assert more == pytest.approx(2.16, rel=0.1)


def test_woodland_follows_weissbergers_law_in_each_band() -> None:
    law = [weissberger(band, 1) for band in (24, 77, 94)]
    assert library_material("woodland").radar_db == pytest.approx(law, abs=0.005)


@pytest.mark.parametrize(
    ("name", "db", "at_ghz"),
    [
        ("sparse_foliage", 0.4, 73),
        pytest.param("twigs", 0.75, 28.8, id="twigs"),
        pytest.param("foliage", 2.5, 28.8, id="in leaf"),
        ("dense_foliage", 6, 38),
        ("wet_foliage", 7, 38),
        pytest.param("hedge", 8, 38, id="hedge"),
    ],
)
def test_library_has_the_losses_of_its_sources(
    name: str, db: float, at_ghz: float
) -> None:
    law = [convert_band(db, at_ghz, band) for band in (24, 77, 94)]
    assert library_material(name).radar_db == pytest.approx(law, abs=0.006)


@pytest.mark.parametrize(
    ("f_ghz", "most"),
    [(0.1059, 9.4), (0.466475, 18.0), (0.949, 26.5), (1.8522, 29.0), (2.1175, 34.1)],
)
def test_most_that_woods_take_is_near_the_values_measured_for_p833(
    f_ghz: float, most: float
) -> None:
    assert p833_most(f_ghz) == pytest.approx(most, abs=3.4)


@pytest.mark.parametrize("band", [24, 77, 94])
def test_loss_that_grows_evenly_is_near_p833_as_far_as_a_radar_sees(band: int) -> None:
    """Its maximum is carried to these bands by its law, 95 to 168 dB."""
    per_metre = library_material("woodland").radar_db[(24, 77, 94).index(band)]
    depth = 20.0 / per_metre  # 40 dB, there and back
    law = p833(per_metre, p833_most(band), depth)
    assert law == pytest.approx(20.0, rel=0.1)
