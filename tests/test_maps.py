"""The shipped maps have what their pages say."""

import math

import numpy as np
import pytest

from radarsim import generator_for, load_sensor
from radarsim.geometry import Floats
from radarsim.plotting.sight import BeamEnd, find_sight
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.map_file import load_map, shipped_maps
from radarsim.scene.scene import Scene

SENSOR = np.array([-8 + 0.2085, 0.0, 0.346])  # on a P3AT at RobotStart1
ANGLES = np.radians(np.arange(-90, 91))
BEYOND = 1.71  # m; no bush reaches this far along x


def ends(scene: Scene, offset: float = 0.0) -> tuple[Floats, Floats]:
    """Return the ends of beams of power 1, (181, 3) m, and the power left there.

    The beams start at an offset to the left of the sensor, m.
    """
    zero = np.zeros_like(ANGLES)
    directions = np.column_stack([np.cos(ANGLES), np.sin(ANGLES), zero])
    left = np.column_stack([-np.sin(ANGLES), np.cos(ANGLES), zero])
    origins = SENSOR + offset * left
    rays = Rays.uniform(origins, directions, max_range=80.0, power=1.0)
    traces = tracer_of(scene).trace(rays)
    return origins + traces.ranges[:, None] * directions, traces.power


@pytest.mark.parametrize("name", ["empty_room", "foliage_room", "smoke_room"])
def test_shipped_map_is_a_room_with_three_starts(name: str) -> None:
    scene = load_map(name)
    assert np.abs(scene.bounds[:, :2]).tolist() == [[10.6, 6.6], [10.6, 6.6]]
    starts = [start.name for start in scene.starts]
    assert starts == ["RobotStart1", "RobotStart2", "RobotStart3"]
    assert scene.starts[0].pose.numbers() == (-8, 0, 0, 0, 0, 0)
    assert scene.floor_at(-8, 0) == 0


def test_every_map_in_the_folder_is_tested() -> None:
    rooms = {"empty_room", "foliage_room", "smoke_room"}
    bugs = {"bug_box", "bug_u_trap", "bug_spiral", "bug_closed_box", "bug_maze"}
    others = {"forest_edge", "marulan_trial", "hedge_garden", "orchard"}
    assert set(shipped_maps()) == rooms | bugs | others


@pytest.mark.parametrize("offset", [-0.4, -0.2, -0.1, 0.0, 0.1, 0.2, 0.4])
def test_radar_sees_past_the_edges_of_the_bushes_but_not_through_them(
    offset: float,
) -> None:
    places, power = ends(load_map("foliage_room"), offset)
    assert np.count_nonzero((places[:, 0] > BEYOND) & (power > 0)) >= 10
    inside = (power == 0) & (places[:, 0] < BEYOND)
    assert np.count_nonzero(inside) >= 40


def test_every_beam_to_the_far_side_meets_a_bush() -> None:
    scene = load_map("foliage_room")
    places, power = ends(scene)
    assert (power[places[:, 0] > 0.5] < 1).all()


def test_smoke_does_not_attenuate_the_radar() -> None:
    scene = load_map("smoke_room")
    places, power = ends(scene)
    assert (power == 1).all()
    parts = tuple(part for part in scene.parts if part.object_name != "cloud")
    clear, _ = ends(Scene("room", "DM-Room", parts))
    assert np.abs(places - clear).max() < 1e-9


NAVTECH = pytest.param("navtech_cir204h", marks=pytest.mark.slow)
REAL_RADARS = ("k2pi", "hss94_marulan", NAVTECH)
TREES = (-0.15, 6.4)  # m; from where to where they stand along y, at x = 0
SMOKE = (-6.4, -0.13)  # m; likewise, at x = -2


def seen_through(map_: str, sensor: str, **settings: object) -> tuple[float, float]:
    """Return the shares of beams that see through the trees, and through the smoke.

    Of the beams that lead there.
    """
    scene, scanner = load_map(map_), load_sensor(sensor, **settings)
    scan = scanner.scan(scene, (SENSOR[0], 0, 0), generator_for(0, sensor))
    through = find_sight(scene, scan).ends == BeamEnd.THROUGH

    def share(x: float, low: float, high: float) -> float:
        ahead = x - SENSOR[0]
        there = (scan.angles > math.atan2(low, ahead)) & (
            scan.angles < math.atan2(high, ahead)
        )
        return float(through[there].mean())

    return share(0.0, *TREES), share(-2.0, *SMOKE)


@pytest.mark.parametrize("radar", REAL_RADARS)
def test_real_radar_sees_through_the_orchard_but_not_through_dense_bushes(
    radar: str,
) -> None:
    trees, smoke = seen_through("orchard", radar)
    assert trees > 0.6
    assert smoke > 0.6
    assert seen_through("orchard@thick_smoke", radar) == (trees, smoke)
    in_leaf, _ = seen_through("orchard@in_leaf", radar)
    assert in_leaf < 0.1
    scene = load_map("foliage_room")
    scan = load_sensor(radar).scan(scene, (SENSOR[0], 0, 0), generator_for(0, radar))
    assert (find_sight(scene, scan).ends != BeamEnd.THROUGH).all()


def test_laser_sees_through_smoke_by_its_last_echo_alone_and_never_through_leaves() -> (
    None
):
    trees, smoke = seen_through("orchard", "physical")
    assert trees == 0
    assert smoke < 0.05  # a share of 0.014 passes 4 m of it
    trees, smoke = seen_through("orchard", "physical", return_mode="last")
    assert trees == 0
    assert smoke > 0.6
    assert seen_through("orchard@thick_smoke", "physical", return_mode="last") == (0, 0)
