import math

import pytest

from radarsim.presets.sensor_settings import METRES_PER_UNIT, offset_angle, offset_units


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
