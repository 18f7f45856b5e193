import math
from typing import get_args

import pytest

from radarsim.errors import PresetError
from radarsim.presets.sensor_settings import BANDS_GHZ, SensorSettings
from radarsim.scene.map_schema import MaterialEntry
from radarsim.scene.material import (
    AMOUNTS,
    Material,
    library,
    library_entry,
    library_material,
    library_names,
)

PLANTS = (
    *("sparse_foliage", "twigs", "woodland", "foliage", "dense_foliage"),
    *("wet_foliage", "hedge", "tall_grass"),
)
BOARDS = ("wood", "plasterboard", "chipboard")
WALLS = ("concrete", "brick", "metal", "rough_metal")
WEATHER = ("smoke", "dust", "fog", "rain")
AIR = (*WEATHER, "atmosphere")


def test_library_holds_the_known_materials() -> None:
    names = {*PLANTS, *BOARDS, *WALLS, *AIR, "glass"}
    assert set(library_names()) == set(library()) == names
    assert list(library_names()) == sorted(names)


def test_materials_have_numbers_for_each_radar_band() -> None:
    assert get_args(SensorSettings.model_fields["band_ghz"].annotation) == BANDS_GHZ


@pytest.mark.parametrize("name", library_names())
def test_every_number_has_a_source(name: str) -> None:
    entry = library_entry(name)
    assert entry.about
    derived = {"db_per_g", "rain_k", "rain_alpha"}
    known = {*MaterialEntry.model_fields, *derived, *(f"laser_{k}" for k in derived)}
    assert entry.numbers.keys() <= known
    for number in entry.numbers.values():
        assert len(number.source) > 8


@pytest.mark.parametrize("name", PLANTS)
def test_plants_stop_light_and_attenuate_radar(name: str) -> None:
    plant = library_material(name)
    assert plant.density == 0
    assert 0 < plant.radar_db[0] < plant.radar_db[1] < plant.radar_db[2]
    assert math.isinf(plant.laser_density)
    assert plant.solid is (name != "tall_grass")


def test_only_glass_and_metal_are_mirrors() -> None:
    glass, metal = library_material("glass"), library_material("metal")
    assert (glass.radar_mirror, glass.laser_mirror) == (True, False)
    assert (metal.radar_mirror, metal.laser_mirror) == (True, True)
    assert math.isinf(glass.density)
    assert glass.laser_density == 0
    others = set(library_names()) - {"glass", "metal"}
    others_ = [library_material(name) for name in others]
    assert not any(each.radar_mirror or each.laser_mirror for each in others_)


def test_pane_of_6_mm_transmits_90_percent_of_light() -> None:
    through = 10 ** (-library_material("glass").laser_db * 0.006 / 10)
    assert through == pytest.approx(0.9, abs=0.01)


def test_only_weather_has_an_amount() -> None:
    amounts = {name: library_entry(name).amount for name in WEATHER}
    assert amounts == {
        **dict.fromkeys(("smoke", "dust", "fog"), AMOUNTS[0]),
        "rain": AMOUNTS[1],
    }
    assert library_entry("wood").amount is None


def test_amount_of_the_wrong_unit_is_rejected() -> None:
    with pytest.raises(PresetError) as caught:
        library_material("rain", g_per_m3=1)
    assert str(caught.value) == "material 'rain': g_per_m3 1, expected mm_per_h"
    with pytest.raises(PresetError, match=r"mm_per_h 3, expected no amount$"):
        library_material("wood", mm_per_h=3)


def test_unknown_material_is_rejected_with_the_known_names() -> None:
    message = (
        r"^material 'wod' \(did you mean 'wood'\?\), expected one of \['atmosphere"
    )
    with pytest.raises(PresetError, match=message):
        library_material("wod")


@pytest.mark.parametrize("name", PLANTS)
def test_deep_canopy_returns_what_is_known_of_plants(name: str) -> None:
    # gamma of a half-space is half the albedo: trees -8 to -10 dB, grass -12 to -15
    gamma = 10 * math.log10(library_material(name).albedo / 2)
    low, high = (-15, -12) if name == "tall_grass" else (-10.001, -8)
    assert low <= gamma <= high


def test_clouds_scatter_nothing_but_rain_by_its_drops() -> None:
    for name in WEATHER:
        assert library_material(name).albedo == 0


@pytest.mark.parametrize(
    ("material", "penetrable"),
    [
        pytest.param(Material("concrete"), False, id="opaque"),
        pytest.param(Material("foliage", density=0.7), True, id="to the radar"),
        pytest.param(Material("glass", laser_density=0.0), True, id="to the laser"),
    ],
)
def test_penetrable_is_what_radar_or_laser_enters(
    material: Material, penetrable: bool
) -> None:
    assert material.penetrable is penetrable
