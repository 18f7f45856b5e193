"""Lasers that read first returns, in smoke: closed forms, by counting beams."""

import math

import numpy as np
import pytest
import yaml
from joint_scans import scan_together
from parts import block

import radarsim
from radarsim.geometry import Floats, Pose3
from radarsim.raycast.rays import Boxes, EventKind
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.scene.build import make_material
from radarsim.scene.map_file import load_variants, shipped_maps
from radarsim.scene.map_schema import MaterialEntry
from radarsim.scene.map_writer import material_keys
from radarsim.scene.material import Material, library_material, library_names
from radarsim.scene.scene import Part, Scene
from radarsim.sensors.scan_batch import ScanRequest

WALL = 40.0  # m
NARROW = {"fov_deg": 0.02, "resolution_deg": 0.0001}  # 201 beams, all straight ahead


def cloud(name: str, near: float, far: float, db: float, density: float = 0.0) -> Part:
    smoke = Material(name, 0.0, density, laser_db=db, solid=False)
    return block(name, smoke, (far - near, 40, 9), ((near + far) / 2, 0, 0))


def smoky(*clouds: Part) -> Scene:
    wall = block("wall", Material("stone"), (1, 40, 9), (WALL + 0.5, 0, 0))
    return Scene("yard", "Yard", (*clouds, wall))


def ranges_of(world: Scene, x: float = 0.0, **settings: object) -> Floats:
    laser = radarsim.load_sensor("physical", **NARROW, **settings)
    scans = laser.scan_many(world, [Pose3(x, 0, 0)] * 50, generator_for(1, "smoke"))
    return scans.ranges.ravel() + x


def check_share(share: float, wanted: float, count: int) -> None:
    assert abs(share - wanted) < 3 * math.sqrt(wanted * (1 - wanted) / count)


def check_law(depths: Floats, depth: float, a: float) -> None:
    """Compare depths, inf behind the cloud, with both closed forms."""
    through = math.exp(-2 * a * depth)
    check_share(np.isinf(depths).mean(), through, len(depths))
    inside = depths[np.isfinite(depths)]
    mean = 1 / (2 * a) - depth * through / (1 - through)
    assert abs(inside.mean() - mean) < 3 * inside.std() / math.sqrt(len(inside))


@pytest.mark.parametrize("x", [0.0, 7.0], ids=["outside", "inside"])
@pytest.mark.parametrize("db", [0.3, 2.3])
def test_beams_answer_in_smoke_by_the_law_of_first_returns(db: float, x: float) -> None:
    ranges = ranges_of(smoky(cloud("smoke", 5, 9, db)), x)
    start = max(x, 5.0)
    behind = np.isclose(ranges, WALL)
    assert ((ranges >= start) & (ranges <= 9.0) | behind).all()
    depths = np.where(behind, np.inf, ranges - start)
    check_law(depths, 9 - start, math.log(10) / 10 * db)


def test_losses_of_overlapping_clouds_add_up() -> None:
    """From 5 m on one cloud, from 6 to 7 m both; and density counts by the margin."""
    world = smoky(cloud("thin", 5, 7, 0.4), cloud("thick", 6, 7, 0.0, density=1.5))
    per_db, ranges = 20 / (40 / 2), ranges_of(world)
    thin = 2 * math.log(10) / 10 * 0.4
    both = thin + 2 * math.log(10) / 10 * 1.5 / per_db
    for place, passed in ((6.0, thin), (7.0, thin + both)):
        check_share((ranges > place).mean(), math.exp(-passed), len(ranges))


def test_answer_is_an_echo_of_the_cloud_that_the_beam_entered_last() -> None:
    outer, inner = cloud("outer", -5, 30, 0.01), cloud("inner", 8, 20, 3.0)
    laser = radarsim.load_sensor("physical", **NARROW)
    scan = laser.scan(smoky(outer, inner), Pose3(0, 0, 0), 1)
    echoes = scan.echoes
    assert len(echoes) == len(scan.ranges)
    assert (echoes.kinds == EventKind.ENTER).all()
    names = [echoes.targets[part].object for part in echoes.parts.tolist()]
    for name, at, front in zip(names, scan.ranges, echoes.fronts, strict=True):
        is_outer = at < 8
        assert name == ("outer" if is_outer else "inner")
        assert front == pytest.approx(0 if is_outer else 8)
    power = 20 - 0.01 * scan.ranges - 3.0 * np.maximum(scan.ranges - 8, 0)
    assert echoes.power == pytest.approx(power)
    assert echoes.strength == pytest.approx(10 ** (-4 * (1 - power / 20)))


def test_robot_in_smoke_is_read_by_the_beams_that_get_so_far() -> None:
    robot = Boxes(np.array([[8.5, 0, 0, -1, 1, 0.5, 0.5, 7]]))  # from 8 m on
    laser, db = radarsim.load_sensor("physical", **NARROW), 0.3
    tracer = tracer_of(smoky(cloud("smoke", 5, 20, db)))
    rng, pose = generator_for(2, "smoke"), Pose3(0, 0, 0)
    scans = scan_together(tracer, [ScanRequest(laser, pose, rng)] * 50, robot)
    ranges = np.array([scan.ranges for scan in scans]).ravel()
    at_robot = np.isclose(ranges, 8.0)
    assert ((ranges >= 5.0) & (ranges < 8.0) | at_robot).all()
    depths = np.where(at_robot, np.inf, ranges - 5)
    check_law(depths, 3.0, math.log(10) / 10 * db)


@pytest.mark.parametrize("name", library_names())
def test_smoke_dust_and_fog_are_the_clouds_of_the_library(name: str) -> None:
    assert library_material(name).is_cloud == (name in {"smoke", "dust", "fog"})


@pytest.mark.parametrize(
    ("keys", "is_cloud"),
    [
        ("based_on: dust, g_per_m3: 0.1, db_per_m: 1", True),
        ("based_on: smoke, solid: true", True),
        ("based_on: smoke, laser_density: opaque", False),
        ("based_on: smoke, laser_db_per_m: 0", False),
        ("based_on: smoke, sheet_loss: 1", False),
        ("based_on: smoke, scatters_light: false", False),
        ("based_on: glass, solid: false", False),
        ("based_on: hedge, laser_density: 0.5, solid: false", False),
        ("based_on: tall_grass, laser_db_per_m: 3", False),
        ("based_on: rain, mm_per_h: 90", False),
        ("density: 0, laser_density: 0.5, solid: false", True),
        ("density: 0, laser_density: 0.5", False),
        ("density: 0, laser_density: 0.5, scatters_light: true", True),
        ("density: 2, laser_density: 0.5, solid: false, scatters_light: false", False),
        ("sheet_loss: 0.1, laser_density: 0.5, solid: false", False),
    ],
)
def test_materials_of_maps_that_are_clouds(keys: str, is_cloud: bool) -> None:
    entry = MaterialEntry.model_validate(yaml.safe_load(f"{{{keys}}}"))
    material = make_material("m", entry)
    assert material.is_cloud == is_cloud
    written = MaterialEntry.model_validate(material_keys(material))
    assert make_material("m", written).is_cloud == is_cloud


def test_clouds_of_the_shipped_maps() -> None:
    found = {
        (name, each.name)
        for name in shipped_maps()
        for scene in load_variants(name)
        for each in scene.materials.values()
        if each.is_cloud
    }
    assert found == {
        ("smoke_room", "smoke"),
        ("orchard", "smoke"),
        ("marulan_trial", "thick_smoke"),
        ("marulan_trial", "dust_cloud"),
    }


@pytest.mark.parametrize(
    "settings",
    [
        {"return_mode": "last"},
        {"return_mode": "strongest"},
        {"return_mode": "all"},
        {"spent_reads": "zero"},
        {"spent_reads": "range"},
        {"penetration_power": math.inf},
        {"penetration_power": 0.0},
    ],
    ids=str,
)
def test_other_lasers_need_no_random_numbers_in_smoke(
    settings: dict[str, object],
) -> None:
    laser = radarsim.load_sensor("physical", **NARROW, **settings)
    ranges = laser.scan(smoky(cloud("smoke", 5, 9, 2.3)), Pose3(0, 0, 0)).ranges
    assert np.ptp(ranges[np.isfinite(ranges)]) == pytest.approx(0, abs=1e-5)


def test_scene_without_clouds_draws_nothing() -> None:
    laser, rng = radarsim.load_sensor("physical"), generator_for(1, "laser")
    before = rng.bit_generator.state
    laser.scan(smoky(), Pose3(0, 0, 0), rng)
    assert rng.bit_generator.state == before
    with pytest.raises(ValueError, match="no rng"):
        laser.scan(smoky(cloud("smoke", 5, 9, 2.3)), Pose3(0, 0, 0))


def test_noise_is_drawn_before_the_depths_in_smoke() -> None:
    laser = radarsim.load_sensor("physical", **NARROW, range_noise=0.02)
    clear = laser.scan(smoky(), Pose3(0, 0, 0), 3).ranges
    far = smoky(cloud("smoke", 60, 70, 2.3))  # behind the wall
    assert laser.scan(far, Pose3(0, 0, 0), 3).ranges.tolist() == clear.tolist()
    noisy = laser.scan(smoky(cloud("smoke", -5, 30, 9.0)), Pose3(0, 0, 0), 3).ranges
    assert (noisy >= 0).all()
