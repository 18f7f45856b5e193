import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mountings import mounting, move, robot_at

from radarsim.geometry import Pose3
from radarsim.presets.robots import Item
from radarsim.presets.sensors import item_settings
from radarsim.protocol.reports import Gps
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import Material
from radarsim.scene.scene import GPS_ORIGIN, Part, Scene
from radarsim.scene.shapes import box
from radarsim.sensors.gps import GpsReceiver, GpsSettings

HERE = Pose3(0, 0, 0)


def receiver(
    origin: tuple[float, float] = GPS_ORIGIN, *, seed: int = 0, **noise: float
) -> GpsReceiver:
    noise = {"max_noise": 0.0, "min_noise": 0.0, **noise}
    settings = item_settings("GPS", GpsSettings, **noise)
    scene = Scene("nowhere", "nowhere", gps_origin=origin)
    rng = np.random.default_rng(seed)
    item = Item(type="GPS", name="GPS")
    return GpsReceiver(
        mounting(item, settings, robot=robot_at(HERE), rng=rng, scene=scene)
    )


def fix(gps: GpsReceiver, place: Pose3 = HERE, parts: tuple[Part, ...] = ()) -> Gps:
    move(gps.robot, place)
    (read,) = gps.read(0.0, Tracer(parts).trace(gps.rays()))
    return read


def roof(length: float, width: float, material: Material) -> Part:
    vertices, faces = box(length, width, 0.1)
    return Part("roof", material, vertices + np.array([0, 0, 3.0]), faces)


def test_origin_of_the_map_is_where_the_original_server_has_it() -> None:
    read = fix(receiver())
    assert read.position is not None
    latitude, longitude = read.position
    assert latitude == pytest.approx(39 + 8.0273 / 60)
    assert longitude == pytest.approx(-(77 + 12.998 / 60))


def test_as_many_satellites_are_in_sight_as_clients_saw_at_the_original_server() -> (
    None
):
    assert fix(receiver()).satellites == 11


def test_x_is_north_and_y_is_west() -> None:
    origin = fix(receiver())
    assert origin.position is not None
    moved = fix(receiver(), Pose3(111.2, -71.67, 0))
    assert moved.position is not None
    difference = np.subtract(moved.position, origin.position)
    assert difference == pytest.approx([1e-3, 1e-3])


def test_longitude_goes_on_beyond_the_date_line() -> None:
    read = fix(receiver((0.0, 179.9999)), Pose3(0, -71.67, 0))
    assert read.position is not None
    assert read.position[1] == pytest.approx(-179.9991)


@given(latitude=st.floats(-89, 89), longitude=st.floats(-180, 180))
def test_there_is_a_fix_in_the_open_everywhere(
    latitude: float, longitude: float
) -> None:
    read = fix(receiver((latitude, longitude)))
    assert 4 <= read.satellites <= 31
    assert read.position == pytest.approx((latitude, math.remainder(longitude, 360)))


@pytest.mark.parametrize(
    ("material", "satellites"),
    [
        pytest.param(Material("concrete"), 0, id="concrete"),
        pytest.param(Material("foliage", density=0.7), 0, id="foliage"),
        pytest.param(
            Material("smoke", density=0.0, laser_density=0.5, solid=False),
            11,
            id="smoke",
        ),
    ],
)
def test_what_stops_a_sonar_hides_the_satellites(
    material: Material, satellites: int
) -> None:
    read = fix(receiver(), parts=(roof(40, 40, material),))
    assert read.satellites == satellites
    assert (read.position is None) is (satellites == 0)


def test_roof_hides_only_the_satellites_behind_it() -> None:
    counts = [
        fix(receiver(), parts=(roof(size, size, Material("roof")),)).satellites
        for size in (0.1, 0.6, 1.2, 1.8, 3.0)
    ]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] == 11
    assert counts[-1] == 0
    assert len(set(counts)) > 3


def test_fewer_than_four_satellites_give_no_fix() -> None:
    for size in np.linspace(0.1, 3, 30).tolist():
        read = fix(receiver(), parts=(roof(size, size, Material("roof")),))
        assert (read.position is None) is (read.satellites < 4)


def test_error_has_the_standard_deviation_of_the_original_server() -> None:
    gps = receiver(seed=1, max_noise=2.5, min_noise=0.75)
    traces = Tracer(()).trace(gps.rays())
    reads = [gps.read(0.0, traces)[0].position or (0, 0) for _ in range(4000)]
    errors = np.subtract(reads, GPS_ORIGIN) * [111_200, 71_670]
    sigma = (2.5 + (0.75 - 2.5) * (11 - 4) / 8) / 3
    assert errors.std(axis=0) == pytest.approx([sigma, sigma], rel=0.05)
    assert np.abs(errors.mean(axis=0)).max() < 4 * sigma / math.sqrt(4000)


def test_with_very_many_satellites_there_is_no_error() -> None:
    equator = (0.0, 5.0)
    read = fix(receiver(equator, max_noise=1))
    assert read.satellites == 13
    assert read.position == pytest.approx(equator, abs=1e-12)


def test_fix_or_not_the_next_error_is_the_same() -> None:
    nexts = []
    for parts in ((), (roof(40, 40, Material("roof")),)):
        gps = receiver(seed=2, max_noise=2.5, min_noise=0.75)
        fix(gps, parts=parts)
        nexts.append(fix(gps))
    assert nexts[0] == nexts[1]
