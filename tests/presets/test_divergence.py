import math

import pytest
from oracles.gaussian_beam import side_ray_angle

from radarsim.presets.sensor_settings import METRES_PER_UNIT, offset_angle, offset_units

WIDTH = math.radians(1.8)  # between the one-way half-power points of a beam


@pytest.mark.parametrize(
    ("distance", "degrees"),
    [
        pytest.param(5, (1.146, 2.291, 4.574), id="5 m"),
        pytest.param(10, (0.573, 1.146, 2.291), id="10 m"),
        pytest.param(20, (0.286, 0.573, 1.146), id="20 m"),
        pytest.param(40, (0.143, 0.286, 0.573), id="40 m"),
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


@pytest.mark.parametrize(
    ("units", "width"),
    [pytest.param(25, 0.57, id="25 units"), pytest.param(100, 2.3, id="100 units")],
)
def test_offset_at_20_m_is_half_of_a_known_beamwidth(
    units: float, width: float
) -> None:
    assert 2 * math.degrees(offset_angle(units, 20)) == pytest.approx(width, rel=0.01)


@pytest.mark.parametrize("distance", [0.1, 10, 1000])
@pytest.mark.parametrize("units", [0, 1, 50, 1e5])
def test_offset_survives_conversion_to_an_angle_and_back(
    units: float, distance: float
) -> None:
    angle = offset_angle(units, distance)
    assert offset_units(angle, distance) == pytest.approx(units, rel=1e-9)


def test_one_metre_at_one_metre_is_45_degrees() -> None:
    assert offset_angle(1 / METRES_PER_UNIT, 1) == pytest.approx(math.pi / 4)


def test_quadrature_side_ray_is_0_52_beamwidths_off() -> None:
    assert side_ray_angle(1.0) == pytest.approx(0.5201, abs=5e-5)
    assert side_ray_angle(0.0) == 0.0


def test_three_quadrature_rays_have_the_moments_of_the_two_way_beam() -> None:
    def power(angle: float) -> float:  # transmitted and received
        return math.exp(-4 * math.log(2) * (angle / WIDTH) ** 2) ** 2

    angles = [WIDTH * k / 1000 for k in range(-4000, 4001)]
    whole = math.fsum(power(angle) for angle in angles)
    side = side_ray_angle(WIDTH)
    for order in (2, 4):
        moment = math.fsum(power(a) * a**order for a in angles) / whole
        assert (side**order + side**order) / 6 == pytest.approx(moment, rel=1e-9)
