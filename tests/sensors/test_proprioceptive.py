import math
from typing import Any

import pytest

from radarsim.errors import PresetError
from radarsim.presets.sensor_settings import InsNoise
from radarsim.sensors.motion_readings import encoded_wheels


def test_noise_is_read_from_settings() -> None:
    assert InsNoise.from_settings({}) == InsNoise(0.05, 0.5e-3, 0.5e-6)
    assert InsNoise.from_settings({"sigma": 0, "position_bias": 1.5}) == InsNoise(
        sigma=0, position_bias=1.5
    )


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        pytest.param(
            {"sigm": 1},
            "INS setting 'sigm', expected one of"
            " ['sigma', 'position_bias', 'angle_bias']; did you mean 'sigma'?",
            id="unknown",
        ),
        pytest.param(
            {"sigma": -1}, "INS setting sigma: -1, expected 0 to 10", id="negative"
        ),
        pytest.param(
            {"sigma": "much"},
            "INS setting sigma: 'much', expected 0 to 10",
            id="text",
        ),
        pytest.param(
            {"angle_bias": True},
            "INS setting angle_bias: True, expected 0 to 10",
            id="boolean",
        ),
        pytest.param(
            {"sigma": math.nan}, "INS setting sigma: nan, expected 0 to 10", id="nan"
        ),
        pytest.param(
            {"sigma": math.inf},
            "INS setting sigma: inf, expected 0 to 10",
            id="infinite",
        ),
    ],
)
def test_invalid_settings_are_rejected(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(PresetError) as caught:
        InsNoise.from_settings(settings)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("name", "wheels"),
    [
        pytest.param("W1", ["W1"], id="one"),
        pytest.param("EncTestW0W3", ["W0", "W3"], id="two"),
        pytest.param("W4", [], id="no such wheel"),
        pytest.param("Encoder", [], id="none"),
    ],
)
def test_encoder_counts_the_wheels_in_its_name(name: str, wheels: list[str]) -> None:
    counted = encoded_wheels(name, ("right", "left", "right", "left"))
    assert [wheel.name for wheel in counted] == wheels
