import math
from typing import Any

import pytest

from radarsim.errors import PresetError
from radarsim.presets.sensor_settings import (
    METRES_PER_UNIT,
    SensorSettings,
    offset_angle,
    offset_units,
)
from radarsim.presets.sensors import (
    MOST_SETTINGS,
    load_settings,
    parse_setting,
    parse_settings,
)


@pytest.mark.parametrize(
    ("fov", "step", "beams"),
    [
        pytest.param(180, 1, 181, id="half a circle"),
        pytest.param(359, 1, 360, id="a full circle"),
        pytest.param(270, 0.25, 1081, id="quarter degrees"),
        pytest.param(10, 3, 4, id="a step that does not divide it"),
        pytest.param(1, 1, 2, id="two beams"),
    ],
)
def test_scan_has_one_beam_more_than_steps(fov: float, step: float, beams: int) -> None:
    settings = load_settings("radar", fov_deg=fov, resolution_deg=step)
    assert settings.beams == beams


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ("fov_deg=-3", "fov_deg: -3, expected at least 0.0001"),
        ("max_range=.nan", "max_range: nan, expected a finite number"),
        (
            "side_mode=both",
            "side_mode: 'both', expected 'perpendicular',"
            " 'lateral', 'divergent' or 'cone'",
        ),
        (
            "ray_weights=0,0,0",
            "ray_weights (0.0, 0.0, 0.0), expected a sum above 0",
        ),
        (
            "resolution_deg=300",
            "resolution_deg 300, expected at most fov_deg 180",
        ),
        (
            "resolution_deg=0.00011",
            "1636365 beams, expected at most 1000000",
        ),
        (
            "range_quantum=1e-09",
            "range_quantum: 1e-09, expected 0 or at least 1e-06",
        ),
        (
            "side_mode=cone cone_rays=10000 cone_sampling=random",
            "1810000 rays, expected at most 1000000",
        ),
        (
            "side_mode=cone cone_rays=371 beamwidth_az_deg=4",
            "cone_rays 371 have 371 rays in a row, expected at most 100 with"
            " cone_sampling 'quadrature'",
        ),
        (
            "side_mode=cone",
            "a cone of 9 rays, expected a beamwidth_az_deg or a"
            " beamwidth_el_deg above 0",
        ),
        (
            "name=radar",
            "no setting 'name', expected one of "
            + str(sorted(SensorSettings.model_fields)),
        ),
        (
            "side_mode=cone cone_rays=7 beamwidth_az_deg=2 beamwidth_el_deg=2",
            "cone_rays 7 with two beamwidths, expected a product of two"
            " numbers above 1, such as 9 or 16",
        ),
    ],
)
def test_invalid_setting_is_rejected(settings: str, text: str) -> None:
    with pytest.raises(PresetError) as caught:
        load_settings("radar", **parse_settings(settings))
    assert str(caught.value) == f"sensor radar: {text}"


@pytest.mark.parametrize(
    ("widths", "rays", "grid"),
    [
        pytest.param((2, 2), 9, (3, 3), id="square"),
        pytest.param((4, 20), 15, (5, 3), id="more across than up"),
        pytest.param((2, 0), 5, (5, 1), id="across alone"),
        pytest.param((0, 2), 5, (1, 5), id="up alone"),
        pytest.param((2, 2), 1, (1, 1), id="one ray"),
    ],
)
def test_quadrature_forms_a_grid(
    widths: tuple[float, float], rays: int, grid: tuple[int, int]
) -> None:
    settings = load_settings(
        "radar",
        side_mode="cone",
        beamwidth_az_deg=widths[0],
        beamwidth_el_deg=widths[1],
        cone_rays=rays,
    )
    assert settings.cone_grid == grid
    assert settings.rays_per_beam == rays


def test_lasers_have_one_ray_per_beam() -> None:
    assert (
        load_settings("laser", side_mode="cone", beamwidth_az_deg=2).rays_per_beam == 1
    )
    assert load_settings("radar").rays_per_beam == 3


def test_all_invalid_settings_are_reported_at_once() -> None:
    with pytest.raises(PresetError) as caught:
        load_settings("radar", fov_deg=0, max_rnge=5)
    lines = str(caught.value).splitlines()
    assert len(lines) == 2
    message = "no setting 'max_rnge' (did you mean 'max_range'?), expected one of ["
    assert lines[1].startswith(f"sensor radar: {message}")


def test_unknown_sensor_is_rejected_with_the_known_names() -> None:
    with pytest.raises(PresetError, match=r"sensor 'rader' .*, expected one of \['hok"):
        load_settings("rader")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("max_range=20", 20),
        ("max_range=2.5", 2.5),
        ("penetration_power=.inf", math.inf),
        ("side_mode=lateral", "lateral"),
        ("ray_weights=1,2,1", [1, 2, 1]),
        ("ray_weights=[1, 2, 1]", [1, 2, 1]),
    ],
)
def test_setting_on_the_command_line_is_parsed(text: str, value: object) -> None:
    key = text.partition("=")[0]
    assert parse_setting(text) == (key, value)


@pytest.mark.parametrize("text", ["max_range", "=3", "  =3", "a=[1", "a=!!python/x 1"])
def test_invalid_setting_text_is_rejected(text: str) -> None:
    with pytest.raises(PresetError, match="expected KEY=VALUE"):
        parse_setting(text)


@pytest.mark.parametrize(
    ("text", "settings"),
    [
        ("a=1", {"a": 1}),
        (" a=1, b=2 ,c=3\td=4, ", {"a": 1, "b": 2, "c": 3, "d": 4}),
        ("a=1,2,1 b = [1, 2],c=first", {"a": [1, 2, 1], "b": [1, 2], "c": "first"}),
        ("a=1 a=2", {"a": 2}),
        ("a=", {"a": None}),
    ],
)
def test_several_settings_are_parsed(text: str, settings: dict[str, Any]) -> None:
    assert parse_settings(text) == settings


@pytest.mark.parametrize(
    "text", ["", ",", "a", "a b=1", "=1", "a=1 " * MOST_SETTINGS * 2]
)
def test_what_are_no_settings_is_refused(text: str) -> None:
    with pytest.raises(PresetError, match="expected"):
        parse_settings(text)


@pytest.mark.parametrize(
    ("distance", "degrees"),
    [
        pytest.param(5, (1.146, 2.291, 4.574), id="5 m"),
        pytest.param(100, (0.057, 0.115, 0.229), id="100 m"),
    ],
)
def test_offset_at_a_distance_is_an_angle(
    distance: float, degrees: tuple[float, ...]
) -> None:
    angles = [math.degrees(offset_angle(n, distance)) for n in (25, 50, 100)]
    assert angles == pytest.approx(degrees, abs=5.1e-4)


@pytest.mark.parametrize(
    ("width", "distance", "units"),
    [
        pytest.param(2.0, 40, 175, id="2 degrees at 40 m"),
        pytest.param(1.8, 100, 393, id="1.8 degrees at 100 m"),
        pytest.param(4.0, 100, 873, id="4 degrees at 100 m"),
    ],
)
def test_half_a_beamwidth_converts_to_an_offset(
    width: float, distance: float, units: int
) -> None:
    assert round(offset_units(math.radians(width / 2), distance)) == units


@pytest.mark.parametrize("distance", [0.1, 10, 1000])
@pytest.mark.parametrize("units", [0, 1, 50, 1e5])
def test_offset_survives_conversion_to_an_angle_and_back(
    units: float, distance: float
) -> None:
    angle = offset_angle(units, distance)
    assert offset_units(angle, distance) == pytest.approx(units, rel=1e-9)


def test_one_metre_at_one_metre_is_45_degrees() -> None:
    assert offset_angle(1 / METRES_PER_UNIT, 1) == pytest.approx(math.pi / 4)
