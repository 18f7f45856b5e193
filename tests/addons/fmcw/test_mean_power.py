"""The mean power of echoes, against closed forms."""

import math

import numpy as np
import pytest
from fmcw_scenes import (
    EYE,
    LEAVES,
    block,
    db,
    dbm,
    echo_power,
    echoes_of,
    pole_at,
    radar,
    received_power,
    scene_of,
    wall_at,
)

import radarsim
from radarsim.addons.fmcw.antenna import (
    directivity,
    elevation_pattern,
    fixed_viewpoints,
)
from radarsim.addons.fmcw.radar import FmcwRadar
from radarsim.addons.fmcw.radar_equation import radar_constant
from radarsim.geometry import Pose3
from radarsim.raycast.rays import EventKind, Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.material import library_material
from radarsim.scene.scene import Reflector, Scene

GAMMA = 0.1  # of a wall
METAL = library_material("metal")


def beam_filling_power(which: FmcwRadar, distance: float, gamma: float) -> float:
    """Return Pt G^2 lambda^2 sigma0 az el / (512 ln 2 pi^2 R^2 L), W."""
    it = which.settings
    sent = 1e-3 * 10 ** ((it.transmit_dbm - it.loss_db) / 10)
    az, el = math.radians(it.beamwidth_az_deg), math.radians(it.beamwidth_el_deg)
    gain = 16 * math.log(2) / (az * el)
    beam = az * el / (512 * math.log(2) * math.pi**2 * distance**2)
    return sent * gain**2 * it.wavelength**2 * gamma * beam


def total_ahead(which: FmcwRadar, scene: Scene, pose: Pose3 = EYE) -> float:
    return float(echo_power(which, scene, pose)[0].sum())


def test_gain_of_a_gaussian_beam() -> None:
    assert db(directivity(radar().settings)) == pytest.approx(37.04, abs=0.005)
    exact = 16 * math.log(2) / (math.radians(1.8) * math.radians(4))
    assert db(directivity(radar().settings) / exact) == pytest.approx(0, abs=1e-3)


def test_beam_of_a_navtech_has_shoulders_like_those_of_real_images() -> None:
    """Two-way, by directions 0.9 degrees apart, of a pole and of a point.

    A Gaussian of 1.8 degrees has -6.0 and -24.1 dB in the first two. In images of
    RADIATE single bright things have the next three, and nothing is 85 dB below them.
    """
    which = radarsim.load_sensor("navtech_cts350x_radiate").fmcw
    pole = echo_power(which, scene_of(pole_at(30, 0, 0.05, 3))).max(axis=1)
    point = Scene("", "", (), reflectors=(Reflector("", (30, 0, 1), rcs_dbsm=60),))
    tones = which.tones(point, fixed_viewpoints(EYE, which.times(0)), range(400))
    for power in (pole, tones.power):
        found = db(power / power[0])
        assert found[[1, 2]] == pytest.approx([-6.0, -24.1], abs=2.3)
        assert found[[3, 4, 5]] == pytest.approx([-29.5, -40.5, -46.0], abs=2.3)
        assert found[-5:-3] == pytest.approx(found[[5, 4]], abs=0.5)
        assert found[20:-20] == pytest.approx(-85, abs=0.2)


def test_fan_takes_gain_from_the_middle_of_the_beam() -> None:
    plain, filled = (
        directivity(radar().settings),
        directivity(radar(fan_deg=25).settings),
    )
    assert -1.5 < db(filled / plain) < -0.1


def test_point_under_a_cosecant_squared_fan_returns_the_same_at_all_ranges() -> None:
    settings = radar(fan_deg=25).settings
    ranges = np.array([3.0, 5.0, 10.0, 14.0])  # 0.35 m below: 6.7 to 1.4 degrees
    below = -np.arcsin(1.0 / ranges)
    power = elevation_pattern(settings, below) ** 2 / ranges**4
    assert db(power / power[0]) == pytest.approx(0, abs=1e-9)


def test_wall_that_fills_the_beam_returns_by_probert_jones() -> None:
    which = radar()
    expected = beam_filling_power(which, 10, GAMMA)
    assert dbm(expected) == pytest.approx(-59.09, abs=0.01)
    assert dbm(total_ahead(which, wall_at(10))) == pytest.approx(
        dbm(expected), abs=0.05
    )


def test_wall_falls_by_6_db_as_its_distance_doubles() -> None:
    powers = [total_ahead(radar(), wall_at(distance)) for distance in (10, 20, 40, 80)]
    assert np.diff(db(powers)) == pytest.approx([-6.02] * 3, abs=0.05)


def test_smooth_wall_returns_what_a_flat_mirror_does_on_top() -> None:
    """Of a mirror as large as the beam: K pi Gamma^2 / R^2, without the pattern."""
    reflected, slope = 0.15, 0.3
    smooth = radarsim.Material(
        "smooth", specular_db=db(reflected), slope_deg=slope, backscatter_db=-200
    )
    which = radar(bins=1000, beamwidth_az_deg=10, beamwidth_el_deg=10, rays_up=64)
    expected = radar_constant(which.settings) * math.pi * reflected / 10**2
    found = total_ahead(which, wall_at(10, smooth))
    # The lobe is a tenth of the beam wide, where the two-way pattern has 0.98.
    assert db(found / expected) == pytest.approx(0, abs=0.3)


@pytest.mark.parametrize(
    ("side", "distance"), [(0.1, 20.0), (0.1, 40.0), (0.3, 150.0), (0.3, 60.0)]
)
def test_plate_of_metal_returns_what_its_area_does(
    side: float, distance: float
) -> None:
    """4 pi A^2 / lambda^2; nearer than 2 D^2 / lambda by Fresnel's integrals.

    Knott, Radar Cross Section, chapter 5: 19.1 dBsm of 0.1 m, 38.2 dBsm of 0.3 m.
    """
    which = radar(beamwidth_az_deg=4)
    wave = 2 * math.pi / which.settings.wavelength
    cells = ((np.arange(2000) + 0.5) / 2000 - 0.5) * side
    line = np.exp(1j * wave * cells**2 / distance).mean() * side
    plate = block((0.004, side, side), (distance + 0.002, 0, 1), METAL)
    power = echo_power(which, scene_of(plate))[0]
    near = np.abs(which.ranges - distance) < 1
    found = db(power[near].sum() / received_power(which.settings, 1.0, distance))
    assert found == pytest.approx(db(wave**2 / math.pi * abs(line) ** 4), abs=1.3)
    if distance > 4 * side**2 / which.settings.wavelength:
        assert found == pytest.approx(db(wave**2 / math.pi * side**4), abs=0.5)


def test_glint_fades_within_a_few_slopes_of_the_normal() -> None:
    smooth = radarsim.Material("smooth", specular_db=-8.1)
    rough = radarsim.Material("rough")
    which = radar(bins=1000, beamwidth_az_deg=0.5, beamwidth_el_deg=0.5, azimuths=1600)
    for degrees, low, high in ((0, 24, 28.1), (2, 21, 27), (12, 0, 0.1)):
        pose = Pose3(0.0, 0.0, 1.0, 0, 0, math.radians(degrees))
        powers = [
            total_ahead(which, wall_at(10, each), pose) for each in (smooth, rough)
        ]
        assert low <= db(powers[0] / powers[1]) <= high


@pytest.mark.parametrize(("constant_gamma", "share"), [(True, 1), (False, 0.5)])
def test_surface_met_at_60_degrees(constant_gamma: bool, share: float) -> None:
    """Open ground returns as much as head-on, a wall half of that."""
    surface = radarsim.Material("any name", constant_gamma=constant_gamma)
    which, wall = radar(bins=1000), wall_at(10, surface)
    # Level, 10 m from the same wall along the ray, at 60 degrees to its normal.
    slanted = Pose3(5.0, 0, 1, 0, 0, math.radians(60))
    head_on, tilted = (total_ahead(which, wall, pose) for pose in (EYE, slanted))
    assert db(tilted / head_on) == pytest.approx(db(share), abs=0.1)


def test_tall_pole_falls_by_9_db_as_its_distance_doubles() -> None:
    powers = []
    for distance in (10, 20, 40, 80):
        offsets = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75)
        scenes = [scene_of(pole_at(distance, each, 0.05, 60)) for each in offsets]
        found = [echo_power(radar(), each).sum(axis=1).max() for each in scenes]
        powers.append(np.mean(found))
    assert np.diff(db(powers)) == pytest.approx([-9.03] * 3, abs=0.5)


@pytest.mark.parametrize("distance", [10, 20, 40, 80, 160])
def test_thin_pole_shows_its_power_at_every_azimuth_offset(distance: float) -> None:
    """By Lambert's law it returns K gamma (pi r / 2 R) / R^2 over its height."""
    which, radius = radar(), 0.05
    it = which.settings
    half = math.atan(1.0 / distance)
    elevations = np.linspace(-half, half, 2001)
    height = (elevation_pattern(it, elevations) ** 2).mean() * 2 * half
    strength = radar_constant(it) * GAMMA * math.pi * radius / 2 / distance**3
    for offset in np.linspace(-0.45, 0.45, 7):
        across = math.exp(-8 * math.log(2) * (offset / 1.8) ** 2)
        expected = strength * across * height
        pole = pole_at(distance, offset, radius, 2.0)
        assert db(total_ahead(which, scene_of(pole)) / expected) == pytest.approx(
            0, abs=1
        )


def test_foliage_falls_by_twice_its_loss_per_metre() -> None:
    which = radar()
    bush = block((6, 400, 200), (23, 0, 1), LEAVES)
    power = echo_power(which, scene_of(bush))[0]
    rows = (which.ranges > 20.3) & (which.ranges < 24)
    ranges = which.ranges[rows]
    slope = np.polyfit(ranges, db(power[rows] * ranges**2), 1)[0]
    assert slope == pytest.approx(-2 * 3.31, abs=1e-3)


def test_deep_canopy_returns_as_a_surface_of_half_its_albedo() -> None:
    which = radar()
    canopy = scene_of(block((20, 400, 200), (30, 0, 1), LEAVES))
    expected = beam_filling_power(which, 20, 0.2 / 2)
    assert db(total_ahead(which, canopy) / expected) == pytest.approx(0, abs=0.3)


def test_thin_sheets_return_as_the_volume_that_they_fill() -> None:
    density = 1.0  # per metre: 25 dB
    volume = radarsim.Material("volume", density=density)
    spacing = 0.02
    leaf = radarsim.Material("leaf", sheet_loss=density * spacing)
    which = radar(bins=1000)
    boxes = [block((0.001, 60, 40), (10 + i * spacing, 0, 1), leaf) for i in range(20)]
    sheets = [radarsim.Part("leaf", leaf, *_front(each)) for each in boxes]
    solid = block((20 * spacing, 60, 40), (10 + 9.5 * spacing, 0, 1), volume)
    found = total_ahead(which, scene_of(*sheets)) / total_ahead(which, scene_of(solid))
    assert db(found) == pytest.approx(0, abs=0.3)


def _front(part: radarsim.Part) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices and faces of the side that looks to negative x."""
    near = part.vertices[:, 0].min()
    is_front = (part.vertices[part.faces][:, :, 0] == near).all(axis=1)
    return part.vertices, part.faces[is_front]


def test_mirror_shows_a_wall_as_far_as_the_whole_way() -> None:
    mirror = radarsim.Material("mirror", radar_mirror=True)
    # A mirror at 45 degrees, 10 m ahead, that shows a wall 5 m to the side.
    vertices, faces = radarsim.scene.shapes.box(0.01, 20, 40)
    turn = radarsim.geometry.rotation_matrix(0, 0, math.radians(45))
    pane = radarsim.Part("pane", mirror, vertices @ turn.T + [10, 0, 0], faces)
    wall = block((60, 0.2, 60), (0, -5.1, 0))
    which = radar(bins=1000)
    power = echo_power(which, scene_of(pane, wall))[0]
    peak = which.ranges[np.argmax(np.where(which.ranges > 12, power, 0))]
    assert peak == pytest.approx(15, abs=0.1)


def test_approached_wall_seems_nearer_in_an_up_sweep() -> None:
    which, wall = radar(bins=1000), wall_at(20)
    ranges = []
    for speed in (0.0, 10.0):
        view = fixed_viewpoints(EYE, which.times(0), (speed, 0, 0))
        power = echoes_of(which, wall, view).power[0]
        ranges.append((power * which.ranges).sum() / power.sum())
    assert ranges[0] - ranges[1] == pytest.approx(0.554, rel=0.02)


def test_rays_of_a_spectrum_obey_the_law_of_the_thesis(
    foliage_room: Scene,
) -> None:
    """Walked until a loss of 1, they end where the radar's rays do."""
    scan = radarsim.load_sensor("radar", side_offset_uu=0).scan(
        foliage_room, (-8, 0, 0), radarsim.generator_for(0)
    )
    which = radarsim.load_sensor("navtech_cts350x").fmcw
    assert which.ray_class.power_per_db == 1 / 25
    count = len(scan.angles)
    rays = Rays(
        scan.cast.origins,
        scan.cast.directions,
        np.full(count, which.settings.max_range),
        np.full(count, which.full_power),
        np.zeros(count, np.uint8),
        np.full(count, -1),
        (which.ray_class._replace(in_decibels=False),),  # units, as the thesis
    )
    events = tracer_of(foliage_room).trace(rays, events=True).events
    found = np.full(count, np.inf)
    for i in range(count):
        found[i] = _end(events[events["ray"] == i], which.full_power)
    assert (scan.echoes.kinds == EventKind.SPENT).sum() > 20
    assert found == pytest.approx(scan.ranges, abs=1e-9)


def _end(events: np.ndarray, full: float) -> float:
    t, power = 0.0, full
    for event in events:
        loss = full - event["power"]
        if loss >= 1 - 1e-12:
            slope = (power - event["power"]) / (event["t"] - t)
            return float(t + (1 - (full - power)) / slope)
        if event["kind"] == EventKind.HIT:
            return float(event["t"])
        t, power = event["t"], event["power"] - event["absorbed"]
    return math.inf
