"""The shipped sensor presets: their values and sources."""

import pytest

from radarsim.errors import PresetError
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.presets.sensors import (
    SensorPreset,
    item_settings,
    load_settings,
    sensor_presets,
)
from radarsim.sensors.gps import GpsSettings
from radarsim.sensors.sonar import SonarSettings

THESIS = {"radar", "thesis"}
NAVTECH = {
    "navtech_cir204h",
    "navtech_cir304h",
    "navtech_cts350x",
    "navtech_cts350x_radiate",
}
ANTENNAS = NAVTECH | {"hss94_marulan", "k2pi"}
REAL_LASERS = {"hokuyo_urg04lx", "hokuyo_utm30lx", "sick_lms200", "sick_lms291"}
USARSIM = {"usarsim_hokuyo", "usarsim_rangescanner", "usarsim_sick"}
ALL = (
    THESIS | ANTENNAS | REAL_LASERS | USARSIM | {"hokuyo", "laser", "physical", "sick"}
)

presets = pytest.mark.parametrize("name", sorted(ALL))


def preset(name: str) -> SensorPreset:
    return sensor_presets()[name]


def test_shipped_presets_are_the_known_ones() -> None:
    assert set(sensor_presets()) == ALL


@presets
def test_every_value_is_known_and_has_a_source(name: str) -> None:
    load_settings(name)
    for setting, number in preset(name).settings.items():
        assert setting in SensorSettings.model_fields
        assert len(number.source.strip()) > 4, setting
        recalled = "recalled" in number.source and number.confidence != "choice"
        assert not recalled or number.confidence == "nominal", setting


@pytest.mark.parametrize("name", sorted(ALL - {"radar"}))
def test_description_mentions_values_that_are_not_verified(name: str) -> None:
    confidences = {number.confidence for number in preset(name).settings.values()}
    for word in ("nominal", "estimate"):
        assert word not in confidences or word in preset(name).about


@pytest.mark.parametrize(
    ("name", "beams", "step"),
    [
        pytest.param("thesis", 360, 1.0, id="thesis"),
        pytest.param("k2pi", 360, 1.0, id="k2pi"),
        ("hss94_marulan", 180, 2.0),
        *(pytest.param(name, 400, 0.9, id=name) for name in sorted(NAVTECH)),
    ],
)
def test_full_circle_has_no_duplicate_direction(
    name: str, beams: int, step: float
) -> None:
    settings = load_settings(name)
    assert (settings.beams, settings.resolution_deg) == (beams, step)
    assert settings.fov_deg + step == pytest.approx(360)


@pytest.mark.parametrize(
    ("name", "beams", "fov", "max_range"),
    [
        ("hokuyo_urg04lx", 682, 239.4140625, 5.6),
        ("hokuyo_utm30lx", 1081, 270.0, 30),
        ("sick_lms200", 181, 180, 81.92),
        ("sick_lms291", 181, 180, 80),
        ("usarsim_sick", 181, 180, 20),
        ("usarsim_hokuyo", 228, 239.4140625, 4),
        ("usarsim_rangescanner", 21, 179.846, 4),
    ],
)
def test_beams_and_range_of_the_lasers(
    name: str, beams: int, fov: float, max_range: float
) -> None:
    settings = load_settings(name)
    assert (settings.beams, settings.max_range) == (beams, max_range)
    assert settings.fov_deg == pytest.approx(fov, abs=1e-3)


@pytest.mark.parametrize(
    ("name", "bins", "bin_size", "max_range"),
    [
        ("navtech_cts350x", 3768, 0.0438, 165.0),
        ("navtech_cir204h", 3360, 0.0595238, 200.0),
        ("navtech_cts350x_radiate", 576, 0.173611, 100.0),
        ("navtech_cir304h", 3360, 0.0596, 200.256),
    ],
)
def test_range_bins_of_a_data_set_add_up_to_its_range(
    name: str, bins: int, bin_size: float, max_range: float
) -> None:
    settings = load_settings(name)
    assert settings.range_quantum == bin_size
    assert settings.max_range == pytest.approx(bins * bin_size, rel=1e-12)
    assert settings.max_range == pytest.approx(max_range, abs=0.05)


@pytest.mark.parametrize("name", sorted(NAVTECH))
def test_resolution_of_a_radar_is_that_of_its_sweep_not_its_bin(name: str) -> None:
    settings = load_settings(name)
    c = 299_792_458.0
    assert settings.range_resolution == pytest.approx(c / (2 * 863e6), rel=1e-3)
    assert settings.range_resolution > c / (2 * 1e9)  # 76 to 77 GHz
    assert settings.range_quantum <= settings.range_resolution
    assert settings.beamwidth_el_deg > settings.beamwidth_az_deg


@pytest.mark.parametrize("name", sorted(THESIS))
def test_thesis_presets_have_no_noise_or_later_features(name: str) -> None:
    settings = load_settings(name)
    assert settings.range_noise == settings.range_noise_share == 0
    assert settings.range_resolution == settings.range_quantum == 0
    assert not settings.incidence_weights
    assert (settings.return_mode, settings.combines_rays) == ("last", False)
    assert len(set(settings.ray_weights)) == 1


@pytest.mark.parametrize("name", sorted(ANTENNAS))
def test_radar_with_an_antenna_has_a_cone_of_rays(name: str) -> None:
    settings = load_settings(name)
    assert (settings.side_mode, settings.ray_choice) == ("cone", "together")
    assert settings.beamwidth_az_deg > 0
    across, up = settings.cone_grid
    assert across * up == settings.rays_per_beam
    assert (up > 1) == (settings.beamwidth_el_deg > 0)


@pytest.mark.parametrize(
    ("distance", "deviation"),
    [
        pytest.param(1, 0.01, id="near"),
        pytest.param(10, 0.01, id="10 m"),
        pytest.param(30, 0.03, id="far"),
    ],
)
def test_noise_of_the_utm30lx_grows_beyond_10_m(
    distance: float, deviation: float
) -> None:
    settings = load_settings("hokuyo_utm30lx")
    of_range = settings.range_noise_share * distance
    assert max(settings.range_noise, of_range) == pytest.approx(deviation)


@pytest.mark.parametrize(
    ("name", "of", "changed"),
    [
        ("usarsim_sick", "sick", {"max_range", "scan_rate_hz"}),
        ("usarsim_hokuyo", "hokuyo", {"scan_rate_hz"}),
    ],
)
def test_usarsim_variants_differ_only_in_known_settings(
    name: str, of: str, changed: set[str]
) -> None:
    own, shipped = load_settings(name).model_dump(), load_settings(of).model_dump()
    assert {key for key in own if own[key] != shipped[key]} == changed


def test_numbers_of_the_sonar_are_those_of_the_original_server() -> None:
    settings = item_settings("Sonar", SonarSettings)
    assert (settings.beam_angle_deg, settings.min_range, settings.max_range) == (
        20,
        0.1,
        5,
    )


def test_every_number_has_a_source() -> None:
    assert list(sensor_presets("items")) == [
        "camera",
        "co2sensor",
        "gps",
        "humanmotion",
        "rfid",
        "sonar",
        "sound",
        "victsensor",
    ]
    for preset in sensor_presets("items").values():
        assert preset.about
        assert all(number.source for number in preset.settings.values())


def test_all_wrong_settings_are_named_with_what_was_expected() -> None:
    with pytest.raises(PresetError) as error:
        item_settings("Sonar", SonarSettings, max_range=-1, beam_angel_deg=20)
    first, second = sorted(str(error.value).splitlines())
    assert first.startswith("sonar: max_range: -1, expected at least")
    assert second.startswith("sonar: no setting 'beam_angel_deg'")
    assert "did you mean" in second or "beam_angle_deg" in second
    with pytest.raises(PresetError, match="gps: max_noise: 'much', expected a number"):
        item_settings("GPS", GpsSettings, max_noise="much")
