"""Which ray answers, and how exactly."""

import math
from typing import Any

import numpy as np
import pytest
from parts import Triple, block

import radarsim
from radarsim import Material, Part, Scene
from radarsim.geometry import Floats, Pose2, Pose3, rotation_matrix
from radarsim.presets.robots import load_robot
from radarsim.presets.sensors import sensor_presets
from radarsim.rng import generator_for
from radarsim.scene.shapes import box, cylinder
from radarsim.sensors.beams import even_nodes
from radarsim.sensors.range_scanner import SENSOR_HEIGHT, RangeScanner
from radarsim.sensors.scan_batch import ScanArrays
from radarsim.simulation.simulation import Simulation

WALL = Material("wall")
SMOKE = Material("smoke", density=0.0, laser_density=0.5, solid=False)


def board(
    name: str,
    size: Triple,
    place: Triple,
    yaw_deg: float = 0.0,
    material: Material = WALL,
) -> Part:
    return block(name, material, size, place, yaw_deg)


def scene(*parts: Part) -> Scene:
    return Scene("yard", "Yard", parts)


def radar(**settings: Any) -> RangeScanner:
    return radarsim.load_sensor("radar", **settings)


def scans(scanner: RangeScanner, world: Scene, count: int) -> ScanArrays:
    """Take many scans from one place."""
    return scanner.scan_many(world, np.zeros((count, 6)), generator_for(0, "scans"))


def shares(found: ScanArrays, beam: int) -> list[float]:
    """Return how often the right, centre and left ray gave the range."""
    assert found.rays is not None
    return [float(np.mean(found.rays[:, beam] == side)) for side in (-1, 0, 1)]


# Ahead of beam 1 of three, 10 cm apart: the left ray meets an edge at 3 m, the others
# the wall at 8 m behind it.
EDGE = scene(
    board("edge", (1, 4, 4), (3.5, 2.05, 0)), board("back", (1, 40, 4), (8.5, 0, 0))
)
AHEAD = {"fov_deg": 4, "resolution_deg": 2}


def test_scan_without_offset_is_deterministic(foliage_room: Scene) -> None:
    still = radar(side_offset_uu=0)
    rng = generator_for(0)
    first, *others = [still.scan(foliage_room, (-7, 0, 0), rng) for _ in range(5)]
    centre = radar(side_offset_uu=80, ray_weights=(0, 1, 0))
    others.append(centre.scan(foliage_room, (-7, 0, 0), rng))
    assert all(scan.ranges.tolist() == first.ranges.tolist() for scan in others)


def uncertain_share(scanner: RangeScanner, world: Scene) -> float:
    """Return the share of beams whose ranges differ by over 20 cm in 60 scans."""
    rng = generator_for(2, "fray")
    found = scanner.scan_many(world, [(-7.8, 0, 0)] * 60, rng).ranges
    return float(np.mean(np.ptp(found, axis=0) > 0.2))


def test_larger_offset_makes_more_beams_uncertain(foliage_room: Scene) -> None:
    found = [
        uncertain_share(radar(side_offset_uu=n), foliage_room) for n in (0, 25, 50, 100)
    ]
    assert found[0] == 0.0
    assert found == sorted(found)
    assert found[2] > 0.2
    assert found[3] > found[2] + 0.1


# The law of weights by incidence: ray weight times cosine of the angle to the normal.


def test_grazing_ray_is_hardly_ever_selected() -> None:
    grazed = board("grazed", (20, 0.04, 4), (6, 0.12, 0), yaw_deg=-0.3)
    world = scene(grazed, board("back", (1, 0.15, 4), (12.5, 0.0, 0)))
    found = scans(radar(**AHEAD, incidence_weights=True), world, 500)
    assert shares(found, 1)[0] == 0
    assert shares(found, 1)[2] < 0.02  # it weighs as the sine of 0.3 degrees, 0.005


def test_weights_decide_among_rays_that_met_nothing() -> None:
    found = scans(radar(**AHEAD, incidence_weights=True), scene(), 3000)
    wanted, error = 1 / 3, math.sqrt(2 / 9 / 3000)
    assert shares(found, 1) == pytest.approx([wanted] * 3, abs=4 * error)


def test_ray_that_met_nothing_is_not_selected_beside_a_hit() -> None:
    world = scene(board("post", (1, 4, 4), (5.5, 2.05, 0)))
    found = scans(radar(**AHEAD, incidence_weights=True), world, 300)
    assert shares(found, 1) == [0, 0, 1]


@pytest.mark.parametrize("weights", [(1, 1, 1), (1, 2, 0), (0, 1, 3)])
def test_surface_at_60_degrees_weighs_half(
    weights: tuple[float, float, float],
) -> None:
    slanted = board("slanted", (0.01, 0.16, 4), (4, 0.08 + 0.02, 0), yaw_deg=60)
    world = scene(slanted, board("back", (1, 40, 4), (8.5, 0, 0)))
    scanner = radar(**AHEAD, incidence_weights=True, ray_weights=weights)
    found = scans(scanner, world, 6000)
    chances = np.array(weights) * [1, 1, 0.5]
    wanted = chances / chances.sum()
    error = np.sqrt(wanted * (1 - wanted) / 6000)
    assert (np.abs(np.array(shares(found, 1)) - wanted) <= 4 * error).all()


def test_ray_of_weight_zero_is_never_selected_by_incidence() -> None:
    scanner = radar(**AHEAD, incidence_weights=True, ray_weights=(0, 0, 1))
    assert shares(scans(scanner, EDGE, 200), 1) == [0, 0, 1]


def lambert_over_area(yaw: float, width: float) -> float:
    """Return the mean power of a Gaussian beam over a wall 10 m ahead, turned by yaw.

    Patches of the wall, not rays, are summed: a patch dA at R returns cos^2 dA / R^2 of
    what a patch that faces the sensor does, by Lambert's law.
    """
    sigma = width / (4 * math.sqrt(math.log(2)))
    step = 10 * sigma / 40
    along = np.arange(-160, 161) * step / math.cos(yaw)
    up = np.arange(-160, 161) * step
    u, v = np.meshgrid(along, up, indexing="ij")
    x, y, z = 10 - u * math.sin(yaw), u * math.cos(yaw), v
    distance = np.sqrt(x**2 + y**2 + z**2)
    cosine = np.abs(x * math.cos(yaw) + y * math.sin(yaw)) / distance
    left, above = np.arctan2(y, x), np.arcsin(z / distance)
    gain = np.exp(-(left**2 + above**2) / (2 * sigma**2)) / (2 * math.pi * sigma**2)
    area = step**2 / math.cos(yaw)
    return float((gain * cosine**2 * area / distance**2).sum())


@pytest.mark.parametrize("yaw_deg", [0, 30, 60, 80])
def test_mean_power_over_a_slanted_wall_is_that_of_its_area(yaw_deg: float) -> None:
    wall = board("wall", (0.001, 400, 40), (10, 0, 0), yaw_deg=yaw_deg)
    cone = {"side_mode": "cone", "beamwidth_az_deg": 2, "beamwidth_el_deg": 2}
    scanner = radar(
        **AHEAD, **cone, cone_rays=81, incidence_weights=True, return_mode="all"
    )
    echoes = scanner.scan(scene(wall), Pose3(0, 0, 0)).echoes
    found = echoes.strength[echoes.beams == 1].sum()
    assert found == pytest.approx(
        lambert_over_area(math.radians(yaw_deg), math.radians(2)), rel=2e-3
    )
    assert found == pytest.approx(math.cos(math.radians(yaw_deg)), rel=2e-3)


def test_leaves_that_face_all_directions_return_two_thirds() -> None:
    """Of spheres of leaves, each seen by its shadow: the mean over random normals."""
    normals = np.random.default_rng(1).standard_normal((200_000, 3))
    cosines = np.abs(normals[:, 0]) / np.linalg.norm(normals, axis=1)
    wanted = (cosines**2).sum() / cosines.sum()  # a leaf is met as often as it is wide
    bush = board("bush", (9, 9, 9), (8, 0, 0), material=Material("leaf", density=0.5))
    scanner = radar(
        **AHEAD, incidence_weights=True, return_mode="all", side_offset_uu=0
    )
    echoes = scanner.scan(scene(bush), Pose3(0, 0, 0)).echoes
    assert echoes.strength[echoes.beams == 1].sum() == pytest.approx(wanted, rel=5e-3)


@pytest.mark.parametrize("distance", [5.0, 12.0, 27.0, 39.9])
def test_pole_of_10_cm_is_seen_at_every_offset_from_the_beams(distance: float) -> None:
    vertices, faces = cylinder(0.05, 2.0)
    pole = Part("pole", WALL, vertices + np.array([distance, 0, 0.3]), faces)
    scanner = radarsim.load_sensor("hss94_marulan", fov_deg=8)
    offsets = np.radians(np.arange(0, 2, 0.02))
    poses = [Pose3(0, 0, 0, yaw=float(offset)) for offset in offsets]
    ranges = scanner.scan_many(scene(pole), poses, generator_for(3)).ranges
    assert np.isfinite(ranges).any(axis=1).all()
    nearest = np.where(np.isfinite(ranges), ranges, np.inf).min(axis=1)
    assert np.abs(nearest - (distance - 0.05)).max() < 0.6  # noise of 0.1 m


@pytest.mark.parametrize("share", [0.06, 0.5, 0.97])
@pytest.mark.parametrize(
    "preset",
    [
        "navtech_cts350x",
        "navtech_cts350x_radiate",
        "navtech_cir204h",
        "navtech_cir304h",
    ],
)
def test_pole_on_the_ground_is_seen_by_real_radars_at_every_offset(
    preset: str, share: float
) -> None:
    scanner = radarsim.load_sensor(preset, fov_deg=5.4)
    settings = scanner.settings
    distance = share * settings.max_range
    vertices, faces = cylinder(0.05, 2.0)
    upright = np.array([distance, 0, 1.0 - SENSOR_HEIGHT])
    pole = Part("pole", WALL, vertices + upright, faces)
    poses = [
        Pose3(0, 0, 0, yaw=float(yaw))
        for yaw in np.radians(np.linspace(0, settings.resolution_deg, 41))
    ]
    ranges = scanner.scan_many(scene(pole), poses, generator_for(3)).ranges
    nearest = np.where(np.isfinite(ranges), ranges, np.inf).min(axis=1)
    assert nearest == pytest.approx(distance - 0.05, abs=settings.range_resolution)


@pytest.mark.parametrize("count", [1, 2, 19])
def test_even_nodes_are_as_far_apart_and_weigh_as_the_beam(count: int) -> None:
    nodes, weights = even_nodes(count)
    assert weights.sum() == pytest.approx(1.0)
    assert nodes == pytest.approx(-nodes[::-1])
    if count > 1:
        widths = nodes / (4 * math.sqrt(math.log(2)))  # of one-way half-power
        assert widths[[0, -1]] == pytest.approx([-0.6, 0.6])
        assert np.diff(nodes) == pytest.approx(np.full(count - 1, nodes[1] - nodes[0]))
        # twice half of the power, out and back, at half a width
        decibels = 10 * np.log10(weights / weights.max())
        middle = decibels - 2 * 10 * math.log10(0.5) * (widths / 0.5) ** 2
        assert middle == pytest.approx(np.full(count, middle[0]), abs=1e-9)


# All together.


def test_combined_rays_have_farthest_last_and_nearest_first_echo() -> None:
    for mode, wanted in (("last", 8.0), ("first", 3.0), ("strongest", 8.0)):
        scanner = radar(
            **AHEAD, return_mode=mode, ray_choice="together", range_resolution=0.1
        )
        scan = scanner.scan(EDGE, Pose3(0, 0, 0))
        assert scan.ranges[1] == pytest.approx(wanted), mode
    assert scan.echoes.strength[scan.echoes.beams == 1] == pytest.approx([2 / 3])
    assert scan.rays is not None
    assert scan.rays[1] in (-1, 0)


def test_rng_is_required_only_for_random_settings() -> None:
    world, here = EDGE, Pose3(0, 0, 0)
    cone = {"side_mode": "cone", "beamwidth_az_deg": 2, "ray_choice": "together"}
    radar(**cone).scan(world, here)
    for settings in (
        {},
        {**cone, "cone_sampling": "random"},
        {**cone, "range_noise": 0.1},
        {"incidence_weights": True},
    ):
        with pytest.raises(ValueError, match="no rng, expected a Generator"):
            radar(**settings).scan(world, here)
    with pytest.raises(ValueError, match="no rng, expected a Generator"):
        radarsim.load_sensor("laser", range_noise=0.1).scan(world, here)


# The quadrature.


def slanted_wall() -> Scene:
    return scene(board("wall", (0.01, 60, 60), (20, 0, 0), yaw_deg=50))


def mean_range(scanner: RangeScanner, world: Scene) -> tuple[float, float]:
    """Return the mean range of a beam's echoes by strength, and their deviation."""
    echoes = scanner.scan(world, Pose3(0, 0, 0), generator_for(5, "mean")).echoes
    mine = echoes.beams == 1
    weights, ranges = echoes.strength[mine], echoes.ranges[mine]
    mean = float(weights @ ranges / weights.sum())
    return mean, float(np.sqrt(weights @ (ranges - mean) ** 2 / weights.sum()))


def beam(width: float, **settings: Any) -> RangeScanner:
    cone = {"side_mode": "cone", "beamwidth_az_deg": width, "return_mode": "all"}
    return radar(**AHEAD, **cone, **settings)


@pytest.mark.parametrize("width", [0.5, 2.0, 4.0])
def test_three_quadrature_rays_measure_a_slanted_wall_like_a_thousand(
    width: float,
) -> None:
    three, _ = mean_range(beam(width, cone_rays=3), slanted_wall())
    many = beam(width, cone_rays=1000, cone_sampling="random")
    thousand, deviation = mean_range(many, slanted_wall())
    exact, _ = mean_range(beam(width, cone_rays=61), slanted_wall())
    assert abs(three - thousand) < 3 * deviation / math.sqrt(1000)
    assert three == pytest.approx(exact, abs=1e-3 * deviation)


def near_share(scanner: RangeScanner, world: Scene) -> float:
    """Return the share of a beam that the nearest part gives back."""
    echoes = scanner.scan(world, Pose3(0, 0, 0), generator_for(5, "share")).echoes
    mine = (echoes.beams == 1) & (echoes.parts == 0)
    return float(echoes.strength[mine].sum())


def slanted_edge(angle: float) -> Scene:
    """Create a screen at 10 m left of a line that is 30 degrees from vertical.

    Args:
        angle: How far to the left of the beam the line is, rad.
    """
    vertices, faces = box(0.001, 40, 40)
    moved = vertices + np.array([0.0, 20 + 10 * math.tan(angle), 0.0])
    turned = moved @ rotation_matrix(math.radians(30), 0, 0).T + np.array([10, 0, 0])
    screen = Part("screen", WALL, turned, faces)
    return scene(screen, board("back", (1, 90, 90), (30.5, 0, 0)))


@pytest.mark.parametrize(
    ("rays", "worst", "middle"),
    [
        pytest.param(3, 1 / 3, 0.11, id="three rays"),
        pytest.param(16, 0.2, 0.06, id="a grid of sixteen"),
        pytest.param(49, 0.16, 0.05, id="a grid of forty-nine"),
    ],
)
def test_quadrature_error_over_a_slanted_edge_is_within_its_bound(
    rays: int, worst: float, middle: float
) -> None:
    width = 3.0
    sigma = math.radians(width) / (4 * math.sqrt(math.log(2)))
    tall = {} if rays == 3 else {"beamwidth_el_deg": width}
    errors = []
    for step in np.linspace(-2.5, 2.5, 26):
        world = slanted_edge(float(step) * sigma)
        nodes = near_share(beam(width, cone_rays=rays, **tall), world)
        many = beam(width, cone_rays=1000, cone_sampling="random", **tall)
        thousand = near_share(many, world)
        # A flat beam meets the line farther out, on the level.
        apart = float(step) if tall else float(step) / math.cos(math.radians(30))
        exact = 0.5 * math.erfc(apart / math.sqrt(2))
        error = math.sqrt(max(exact * (1 - exact), 1e-4) / 1000)
        assert abs(thousand - exact) < 4 * error + 0.005
        errors.append(nodes - thousand)
    assert np.abs(errors).max() <= worst + 0.05
    assert np.abs(errors).mean() < middle
    assert abs(np.mean(errors)) < 0.02


# Errors of measurement.


def test_noise_has_its_deviation_and_is_independent_per_beam() -> None:
    world = scene(board("back", (1, 400, 4), (8.5, 0, 0)))
    noisy = radar(**AHEAD, side_offset_uu=0, range_noise=0.05)
    found = scans(noisy, world, 4000).ranges
    plain = radar(**AHEAD, side_offset_uu=0).scan(
        world, Pose3(0, 0, 0), generator_for(0)
    )
    error = found - plain.ranges
    assert error.mean() == pytest.approx(0, abs=4 * 0.05 / math.sqrt(error.size))
    assert error.std() == pytest.approx(0.05, abs=4 * 0.05 / math.sqrt(2 * error.size))
    correlation = np.corrcoef(error.T)
    assert np.abs(correlation - np.eye(3)).max() < 4 / math.sqrt(len(found))


def test_larger_of_two_deviations_applies() -> None:
    world = scene(board("back", (1, 400, 4), (8.5, 0, 0)))
    laser = radarsim.load_sensor(
        "laser", **AHEAD, range_noise=0.01, range_noise_share=0.01
    )
    poses = [Pose3(0, 0, 0)] * 3000 + [Pose3(7.5, 0, 0)] * 3000
    far, near = np.split(laser.scan_many(world, poses, 3).ranges[:, 1], 2)
    for found, mean, deviation in ((far, 8.0, 0.08), (near, 0.5, 0.01)):
        assert np.mean(found) == pytest.approx(
            mean, abs=4 * deviation / math.sqrt(3000)
        )
        assert np.std(found) == pytest.approx(deviation, rel=0.06)


def test_noise_keeps_ranges_within_limits_and_adds_none() -> None:
    world = scene(board("back", (1, 0.5, 4), (8.5, 0, 0)))
    noisy = radar(**AHEAD, side_offset_uu=0, range_noise=50, max_range=9)
    found = scans(noisy, world, 300).ranges
    assert np.isinf(found[:, 0]).all()
    assert (found[:, 1].min(), found[:, 1].max()) == (0.0, 9.0)


def test_echoes_of_a_beam_share_one_range_error() -> None:
    leaf = Material("leaf", density=0.1)
    bush = board("bush", (1, 9, 4), (3, 0, 0), material=leaf)
    world = scene(bush, board("back", (1, 40, 4), (8.5, 0, 0)))
    settings = {**AHEAD, "side_offset_uu": 0, "return_mode": "all", "range_noise": 0.3}
    scan = radar(**settings, ray_choice="drawn").scan(
        world, Pose3(0, 0, 0), generator_for(1)
    )
    mine = scan.echoes.beams == 1
    assert np.diff(scan.echoes.fronts[mine]) == pytest.approx([1.0, 4.5])
    # 5 dB out and back: half has come back where (1 + 10^-0.5) / 2 would
    depth = -math.log10((1 + 10**-0.5) / 2) / 0.5
    assert np.diff(scan.echoes.ranges[mine]) == pytest.approx([1.0 - depth, 4.5])


@pytest.mark.parametrize("mode", ["last", "all"])
def test_ranges_are_multiples_of_the_quantum(mode: str, foliage_room: Scene) -> None:
    coarse = radar(range_quantum=0.25, return_mode=mode, max_range=10)
    scan = coarse.scan(foliage_room, (-7, 0, 0), generator_for(1))
    found = scan.ranges[np.isfinite(scan.ranges)]
    assert (found / 0.25).tolist() == np.rint(found / 0.25).tolist()
    fine = radar(return_mode=mode, max_range=10)
    exact = fine.scan(foliage_room, (-7, 0, 0), generator_for(1)).ranges
    there = np.isfinite(exact)
    assert np.abs(found - exact[there]).max() <= 0.125 + 1e-12


def test_quantised_range_does_not_exceed_the_maximum() -> None:
    world = scene(board("back", (1, 40, 4), (19.9, 0, 0)))  # its face is at 19.4 m
    laser = radarsim.load_sensor("laser", **AHEAD, range_quantum=0.7, max_range=19.5)
    assert laser.scan(world, Pose3(0, 0, 0)).ranges[1] == pytest.approx(18.9)


# A bush that begins at 6.9 m takes 10 dB out and back in a metre; half of the nine
# tenths that it returns have come back where 0.55 of the power would.
BUSH_RANGE = 6.9 - math.log10(0.55)


def test_objects_within_the_resolution_merge() -> None:
    leaf = Material("leaf", density=0.2)
    bush = board("bush", (1, 9, 4), (7.4, 0, 0), material=leaf)
    world = scene(bush, board("back", (1, 40, 4), (8.5, 0, 0)))
    settings = {**AHEAD, "side_offset_uu": 0, "return_mode": "all"}
    counts = {}
    for cell in (0.0, 0.5, 2.0):
        scan = radar(**settings, range_resolution=cell).scan(
            world, Pose3(0, 0, 0), generator_for(0)
        )
        echoes = scan.echoes
        counts[cell] = int(np.count_nonzero(echoes.beams == 1))
        assert echoes.strength[echoes.beams == 1].sum() == pytest.approx(1.0)
    assert counts == {0.0: 3, 0.5: 2, 2.0: 1}
    assert scan.ranges[1] == pytest.approx(0.9 * BUSH_RANGE + 0.1 * 8.0)


@pytest.mark.parametrize("mode", ["last", "first", "strongest", "all"])
def test_blinded_laser_reads_zero_in_every_mode(mode: str) -> None:
    cloud = board("cloud", (2, 9, 4), (3, 0, 0), material=SMOKE)
    world = scene(cloud, board("back", (1, 40, 4), (8.5, 0, 0)))
    hokuyo = radarsim.load_sensor("hokuyo", return_mode=mode, max_range=20, **AHEAD)
    assert hokuyo.scan(world, Pose3(0, 0, 0)).ranges.tolist() == [0.0] * 3


def test_ray_without_weight_does_not_blind() -> None:
    """The centre ray is spent in a twig, the side rays see nothing."""
    leaf = Material("twig", density=9.0)
    twig = board("twig", (1, 0.1, 4), (5, 0, 0), material=leaf)
    for mode in ("last", "first", "strongest", "all"):
        scanner = radar(
            **AHEAD,
            ray_weights=(1, 0, 1),
            spent_reads="zero",
            side_offset_uu=50,
            ray_choice="together",
            return_mode=mode,
        )
        scan = scanner.scan(scene(twig), Pose3(0, 0, 0))
        assert math.isinf(scan.ranges[1]), mode


def test_merged_echo_keeps_the_kind_of_the_ray_end() -> None:
    leaf = Material("leaf", density=2.0)
    bush = board("bush", (3, 9, 4), (4.5, 0, 0), material=leaf)
    settings = {**AHEAD, "side_offset_uu": 0, "return_mode": "all"}
    scan = radar(**settings, range_resolution=1.5).scan(scene(bush), Pose3(0, 0, 0))
    lists = scan.to_dict()["echoes"]
    assert [[echo["kind"] for echo in beam] for beam in lists] == [["spent"]] * 3
    assert lists[1][0]["strength"] == pytest.approx(1.0)
    assert lists[1][0]["object"] == "bush"


def test_echo_without_strength_starts_no_merge() -> None:
    pole = board("pole", (0.04, 0.3, 4), (5.17, 0.2, 0))
    world = [pole, board("wall", (1, 40, 4), (5.75, 0, 0))]
    cloud = board("cloud", (3, 40, 4), (6.5, 0, 0), material=SMOKE)
    settings = {**AHEAD, "side_offset_uu": 20, "return_mode": "all"}
    coarse = radar(**settings, range_resolution=0.2)
    for parts in (world, [*world, cloud]):
        lists = coarse.scan(scene(*parts), Pose3(0, 0, 0)).to_dict()["echoes"]
        assert [echo["kind"] for echo in lists[1]] == ["hit"]
        assert lists[1][0]["strength"] == pytest.approx(1.0)


# What scans share.


def test_with_all_echoes_has_the_same_ranges_and_random_numbers(
    foliage_room: Scene,
) -> None:
    for settings in (
        {},
        {"incidence_weights": True},
        {"range_noise": 0.1, "range_quantum": 0.02},
        {"side_mode": "cone", "beamwidth_az_deg": 3, "cone_rays": 5},
        {"ray_choice": "together"},
    ):
        plain = radar(**settings)
        found: list[list[Floats]] = []
        for scanner in (plain, plain.with_all_echoes):
            rng = generator_for(4, "same")
            found.append(
                [scanner.scan(foliage_room, (-7, 1, 0), rng).ranges for _ in range(3)]
            )
        assert np.array_equal(found[0], found[1]), settings


@pytest.mark.parametrize("mode", ["first", "strongest", "all"])
def test_with_all_echoes_is_itself_unless_last_echoes_are_kept(mode: str) -> None:
    scanner = radar(return_mode=mode)
    assert scanner.with_all_echoes is scanner


@pytest.mark.parametrize(
    "settings",
    [
        pytest.param({}, id="drawn"),
        pytest.param({"range_noise": 0.1}, id="noise"),
        pytest.param({"incidence_weights": True}, id="chosen"),
        pytest.param(
            {"side_mode": "cone", "beamwidth_az_deg": 5, "cone_sampling": "random"},
            id="random cone",
        ),
    ],
)
def test_second_robot_does_not_change_the_first_ones_scans(
    settings: dict[str, Any], foliage_room: Scene
) -> None:
    """The second one drives before the first, which draws the same all the same."""
    config = radarsim.SimulationConfig(item_settings={"lms200": settings})
    ranges: list[list[str]] = []
    model = load_robot("P3AT")
    for others in (0, 1):
        simulation = Simulation(foliage_room, config=config, seed=3)
        first = simulation.spawn("R1", model, Pose2(-8, 0))
        assert first is not None
        for i in range(others):
            other = simulation.spawn(f"R{i + 2}", model, Pose2(-5, 3))
            assert other is not None
        lines: list[str] = []
        for _ in range(50):
            simulation.step()
            output = simulation.collect_reports().get(first.number)
            scans_ = output.scans if output else ()
            lines += [str(scan.ranges[:80].tolist()) for scan in scans_]
        ranges.append(lines)
    assert len(ranges[0]) == 5
    assert ranges[0] == ranges[1]


@pytest.mark.parametrize("name", list(sensor_presets()))
def test_every_preset_scans(name: str, foliage_room: Scene) -> None:
    scanner = radarsim.load_sensor(name)
    first, again = (
        scanner.scan(foliage_room, (-8.5, 4, 1), generator_for(1)) for _ in range(2)
    )
    assert first.ranges.tolist() == again.ranges.tolist()
    assert first.ranges.shape == (scanner.settings.beams,)
    seen = first.ranges[np.isfinite(first.ranges)]
    assert seen.size > 0
    assert seen.max() <= scanner.settings.max_range
    quantum = scanner.settings.range_quantum
    if quantum:
        assert seen / quantum == pytest.approx(np.rint(seen / quantum))


# A laser that loses light.

DUST = Material("dust", density=0.0, laser_density=0.0, solid=False, laser_db=1.0)


def dusty(depth: float) -> Scene:
    cloud = board("cloud", (depth, 40, 9), (5 + depth / 2, 0, 0), material=DUST)
    return scene(cloud, board("back", (1, 90, 9), (40.5, 0, 0)))


@pytest.mark.parametrize("mode", ["last", "all", "strongest"])
def test_light_absorbed_in_a_cloud_gives_no_range(mode: str) -> None:
    laser = radarsim.load_sensor("physical", **AHEAD, return_mode=mode)
    inside = laser.scan(dusty(30), Pose3(8, 0, 0))
    assert np.isinf(inside.ranges).all()
    assert laser.scan(dusty(30), Pose3(20, 0, 0)).ranges[1] == pytest.approx(20.0)
    if mode != "all":
        assert len(inside.echoes) == 0
    assert np.isinf(laser.scan(scene(), Pose3(0, 0, 0)).ranges).all()


def test_usarsim_hokuyo_is_blinded_by_its_depth_of_smoke() -> None:
    """A budget of 0.00575 in a density of 0.001 ends after 5.75 m."""
    fog = Material("fog", density=0.0, laser_density=0.001, solid=False)
    back = board("back", (1, 90, 9), (40.5, 0, 0))
    for near, blind in ((0.001, True), (-0.001, False)):
        depth = 5.75 + near
        cloud = board("cloud", (depth, 40, 9), (5 + depth / 2, 0, 0), material=fog)
        settings = {**AHEAD, "max_range": 80}
        hokuyo = radarsim.load_sensor("hokuyo", **settings)
        scan = hokuyo.scan(scene(cloud, back), Pose3(0, 0, 0))
        assert (scan.ranges[1] == 0.0) == blind
        echo = radarsim.load_sensor("hokuyo", **settings, spent_reads="range")
        end = echo.scan(scene(cloud, back), Pose3(0, 0, 0)).ranges[1]
        assert end == pytest.approx(10.75 if blind else 40.0)


def test_side_ray_behind_an_absorber_is_replaced_by_the_centre_ray() -> None:
    black = Material("black", absorption_db=math.inf)
    screen = board("screen", (4, 0.02, 2), (1, 0.1, 0), material=black)
    pole = board("pole", (0.2, 0.2, 2), (6, 0.2, 0))
    world = scene(screen, pole, board("back", (1, 40, 4), (9.5, 0, 0)))
    found = scans(radar(**AHEAD, side_offset_uu=50, ray_weights=(0, 0, 1)), world, 5)
    assert shares(found, 1) == [0, 1, 0]
    assert found.ranges[:, 1] == pytest.approx([9.0] * 5)
