import pytest

from radarsim.errors import PresetError
from radarsim.presets.sensors import item_presets, item_settings
from radarsim.sensors.gps import GpsSettings
from radarsim.sensors.sonar import SonarSettings


def test_numbers_of_the_sonar_are_those_of_the_original_server() -> None:
    settings = item_settings("Sonar", SonarSettings)
    assert (settings.beam_angle_deg, settings.min_range, settings.max_range) == (
        20,
        0.1,
        5,
    )


def test_every_number_has_a_source() -> None:
    assert list(item_presets()) == [
        "camera",
        "co2sensor",
        "gps",
        "humanmotion",
        "rfid",
        "sonar",
        "sound",
        "victsensor",
    ]
    for preset in item_presets().values():
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
