"""The shipped maps have what their pages say."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from radarsim import generator_for, load_sensor
from radarsim.geometry import Floats
from radarsim.plotting.sight import BeamEnd, find_sight
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.map_file import load_map, shipped_maps
from radarsim.scene.material import library_material
from radarsim.scene.scene import Part, Scene

SENSOR = np.array([-8 + 0.2085, 0.0, 0.346])  # on a P3AT at RobotStart1
ANGLES = np.radians(np.arange(-90, 91))
BEYOND = 1.71  # m; no bush reaches this far along x


def fan(offset: float) -> tuple[Floats, Floats]:
    """Return the rays of a fan that starts beside the sensor, to the left, m."""
    zero = np.zeros_like(ANGLES)
    directions = np.column_stack([np.cos(ANGLES), np.sin(ANGLES), zero])
    left = np.column_stack([-np.sin(ANGLES), np.cos(ANGLES), zero])
    return SENSOR + offset * left, directions


def ends(scene: Scene, offset: float = 0.0) -> tuple[Floats, Floats]:
    """Return the ends of beams of power 1, (181, 3) m, and the power left there."""
    origins, directions = fan(offset)
    rays = Rays.uniform(origins, directions, max_range=80.0, power=1.0)
    traces = tracer_of(scene).trace(rays)
    return origins + traces.ranges[:, None] * directions, traces.power


def bushes(scene: Scene) -> list[Part]:
    return [part for part in scene.parts if part.object_name.startswith("bush_")]


def circle(part: Part) -> tuple[Floats, float]:
    """Return the centre of a sphere and the radius of its section at the sensor."""
    low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
    centre: Floats = (low + high) / 2
    radius = (high[2] - low[2]) / 2
    return centre, math.sqrt(radius**2 - (centre[2] - SENSOR[2]) ** 2)


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


def test_middle_of_the_empty_room_is_free() -> None:
    for part in load_map("empty_room").parts:
        if part.object_name != "floor":
            low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
            margin = 0.39  # m; a P3AT turns on the spot within this
            off_x = low[0] > 0 + margin or high[0] < -10 - margin
            off_y = low[1] > 6 + margin or high[1] < -6 - margin
            assert off_x or off_y


def test_neighbouring_bushes_overlap_by_2_to_5_percent_of_their_diameters() -> None:
    circles = [circle(part) for part in bushes(load_map("foliage_room"))]
    assert len(circles) >= 6
    for (one, r), (other, s) in pairwise(circles):
        depth = r + s - np.linalg.norm(one[:2] - other[:2])
        assert 0.02 <= depth / (2 * r) <= 0.05
        assert 0.02 <= depth / (2 * s) <= 0.05


def test_bushes_have_the_specified_radii_and_density() -> None:
    parts = bushes(load_map("foliage_room"))
    radii = [np.ptp(part.vertices[:, 0]) / 2 for part in parts]
    assert min(radii) == pytest.approx(0.8)
    assert max(radii) == pytest.approx(1.2)
    assert {part.material.density for part in parts} == {0.7}


def test_row_of_bushes_has_no_gap_from_wall_to_wall() -> None:
    scene = load_map("foliage_room")
    circles = [circle(part) for part in bushes(scene)]
    # the triangles lie inside of the spheres, by less than half a percent
    edges = [(c[1] - 0.995 * r, c[1] + 0.995 * r) for c, r in circles]
    assert edges[0][0] < -6.4
    assert edges[-1][1] > 6.4
    assert all(b[0] < a[1] for a, b in pairwise(edges))


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


def test_there_are_objects_behind_the_bushes() -> None:
    scene = load_map("foliage_room")
    behind = [part for part in scene.parts if part.vertices[:, 0].min() > BEYOND]
    names = {part.object_name for part in behind} - {"east_wall"}
    assert names == {"crate_low", "crate_high", "cabinet", "pole"}
    assert all(part.vertices[:, 2].max() > SENSOR[2] for part in behind)


def test_cloud_contains_every_start_and_crosses_the_room() -> None:
    scene = load_map("smoke_room")
    (cloud,) = (part for part in scene.parts if part.object_name == "cloud")
    low, high = cloud.vertices.min(axis=0), cloud.vertices.max(axis=0)
    for start in scene.starts:
        sensor = start.pose.position() + np.array([0.0, 0.0, SENSOR[2]])
        assert (sensor > low).all()
        assert (sensor < high).all()
    assert low[1] < -6.4
    assert high[1] > 6.4
    material = cloud.material
    assert (material.density, material.laser_density, material.solid) == (0, 0.5, False)


def test_smoke_does_not_attenuate_the_radar() -> None:
    scene = load_map("smoke_room")
    places, power = ends(scene)
    assert (power == 1).all()
    parts = tuple(part for part in scene.parts if part.object_name != "cloud")
    clear, _ = ends(Scene("room", "DM-Room", parts))
    assert np.abs(places - clear).max() < 1e-9


def test_foliage_and_smoke_room_are_the_same_room() -> None:
    def things(name: str) -> dict[str, list[list[float]]]:
        return {
            part.object_name: part.vertices.tolist()
            for part in load_map(name).parts
            if not part.material.penetrable
        }

    assert things("foliage_room") == things("smoke_room")


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


def test_orchard_has_the_numbers_of_the_library_alone() -> None:
    parts = load_map("orchard").parts
    materials = {part.material.name: part.material for part in parts}
    assert materials.keys() == {"concrete", "wood", "leaves", "smoke"}
    for name, of_library in (("leaves", "sparse_foliage"), ("smoke", "smoke")):
        assert materials[name] == replace(library_material(of_library), name=name)
