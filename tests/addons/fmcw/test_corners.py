"""What comes back by two surfaces at right angles."""

import math
from dataclasses import replace

import numpy as np
import pytest
from fmcw_scenes import (
    EYE,
    PLAIN,
    block,
    db,
    echo_power,
    radar,
    received_power,
    scene_of,
)

from radarsim.addons.fmcw.antenna import fixed_viewpoints
from radarsim.addons.fmcw.beat_signal import Tones
from radarsim.addons.fmcw.corners_and_edges import corner_points
from radarsim.addons.fmcw.radar_equation import noise_power
from radarsim.geometry import rotation_matrix
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.material import Material, library_material
from radarsim.scene.scene import Part, Scene
from radarsim.scene.shapes import box

THICK = 0.01  # m
METAL = library_material("metal")
EYE_AT = np.array([EYE.x, EYE.y, EYE.z])
CONCRETE = library_material("concrete")
WIDE = radar(beamwidth_az_deg=12, beamwidth_el_deg=12)
SMOOTH = replace(CONCRETE, slope_deg=0.2)


def corner_of(
    a: float, b: float, distance: float, yaw_deg: float = 0, material: Material = METAL
) -> Scene:
    """Return a corner of two plates, a wide and b high, that opens to ``EYE``."""
    vertices, faces = box(a, THICK, b)
    first = vertices + np.array([-a / 2, THICK / 2, 0])
    second = vertices @ rotation_matrix(0, 0, math.pi / 2).T
    second = second + np.array([THICK / 2, -a / 2, 0])
    turn = rotation_matrix(0, 0, math.radians(yaw_deg - 45))
    plates = [
        Part(name, material, each @ turn.T + np.array([distance, 0, EYE.z]), faces)
        for name, each in (("first", first), ("second", second))
    ]
    return scene_of(*plates)


def cross_section(scene: Scene, distance: float, beam_deg: float = 4) -> float:
    """Return the cross section of the object straight ahead, dBsm."""
    which = radar(beamwidth_az_deg=beam_deg, beamwidth_el_deg=beam_deg)
    power = echo_power(which, scene)[0]
    near = np.abs(which.ranges - distance) < 1
    return float(db(power[near].sum() / received_power(which.settings, 1.0, distance)))


def tones_of(scene: Scene) -> Tones:
    """Return the echoes of points straight ahead in a wide beam."""
    return WIDE.tones(scene, fixed_viewpoints(EYE, WIDE.times(0)[:1]), range(1))


def cross_section_of_tones(scene: Scene, distance: float) -> float:
    """Return the cross section of the corners straight ahead, dBsm, in a wide beam."""
    tones = tones_of(scene)
    ahead = tones.power[np.abs(tones.ranges - distance) < 0.01].sum()
    unit = received_power(WIDE.settings, 1.0, distance)
    return float(db(ahead * noise_power(WIDE.settings) / unit))


@pytest.mark.parametrize(("a", "b"), [(0.1, 0.1), (0.06, 0.15), (0.12, 0.08)])
@pytest.mark.parametrize("yaw_deg", [0, 8])
def test_corner_of_plates_is_a_dihedral(a: float, b: float, yaw_deg: float) -> None:
    """8 pi a^2 b^2 / lambda^2 beyond the far field; Knott, Radar Cross Section."""
    wavelength, distance = radar().settings.wavelength, 30.0
    expected = db(8 * math.pi * (a * b / wavelength) ** 2)
    # Turned, the narrower plate limits what both reflect.
    expected += 20 * math.log10(
        math.sin(math.radians(45 - yaw_deg)) / math.sin(math.radians(45))
    )
    found = cross_section(corner_of(a, b, distance, yaw_deg), distance)
    assert found == pytest.approx(expected, abs=1)


def trihedral_of(side: float, distance: float, sides: int) -> Scene:
    """Return three plates at right angles that open to ``EYE``, squares or halves."""
    ahead = np.ones(3) / math.sqrt(3)
    across = np.array([1, -1, 0]) / math.sqrt(2)
    frame = np.array([-ahead, across, np.cross(across, ahead)])
    faces = np.array([[0, 1, 2], [0, 2, 3]] if sides == 4 else [[0, 1, 3]])
    parts, edges = [], np.eye(3) * side
    for one, other in zip(edges, np.roll(edges, -1, axis=0), strict=True):
        corners = np.array([0 * one, one, one + other, other]) @ frame.T
        parts.append(
            Part("plate", METAL, corners + np.array([distance, 0, EYE.z]), faces)
        )
    return scene_of(*parts)


@pytest.mark.parametrize(("side", "distance"), [(0.1, 30.0), (0.3, 150.0)])
@pytest.mark.parametrize(("sides", "factor"), [(4, 12.0), (3, 4 / 3)])
def test_corner_of_three_plates_is_a_trihedral(
    side: float, distance: float, sides: int, factor: float
) -> None:
    """12 pi a^4 / lambda^2 of squares, 4 pi a^4 / (3 lambda^2) of triangles.

    Knott, Radar Cross Section, chapter 6; of three squares of 0.3 m 43.0 dBsm.
    """
    expected = db(factor * math.pi * side**4 / radar().settings.wavelength ** 2)
    found = cross_section(trihedral_of(side, distance, sides), distance)
    assert found == pytest.approx(expected, abs=1.7)


def test_corner_of_large_walls_returns_as_a_mirror_of_metal() -> None:
    """Walls of 2 x 3 m at 20 m are larger than what takes part: pi R^2."""
    # The slopes of both walls make a lobe that a narrow beam cuts off.
    found = cross_section(corner_of(2, 3, 20.0), 20.0, beam_deg=12)
    assert found == pytest.approx(db(math.pi * 20**2), abs=1.5)


def echo_of_walls(index: float, angle: float) -> float:
    """Return the share of the power that two walls reflect, by Fresnel's formulas.

    Both polarisations, each over both walls, and their mean; Born and Wolf, Principles
    of Optics, in their form of sines and tangents.

    Args:
        index: Refractive index.
        angle: Of incidence on the first wall, rad.
    """
    upright = level = 1.0
    for each in (angle, math.pi / 2 - angle):
        inner = math.asin(math.sin(each) / index)
        upright *= math.sin(each - inner) / math.sin(each + inner)
        level *= math.tan(each - inner) / math.tan(each + inner)
    return (upright**2 + level**2) / 2


# Of concrete, 0.154 of the power is reflected head-on; ITU-R P.2040-3.
INDEX = (1 + math.sqrt(0.154)) / (1 - math.sqrt(0.154))


@pytest.mark.parametrize("yaw_deg", [0, 10])
def test_corner_of_concrete_returns_what_fresnel_leaves_of_a_mirror(
    yaw_deg: float,
) -> None:
    """Walls of 2 x 3 m at 20 m: pi R^2, 31 dBsm; about 19 of it if E is upright."""
    angle = math.radians(45 - yaw_deg)
    expected = db(math.pi * 20**2 * echo_of_walls(INDEX, angle))
    scene = corner_of(2, 3, 20.0, yaw_deg, SMOOTH)
    assert cross_section_of_tones(scene, 20.0) == pytest.approx(expected, abs=0.5)


@pytest.mark.parametrize(("a", "b"), [(0.1, 0.1), (0.06, 0.15)])
def test_corner_of_small_pieces_of_concrete_is_a_dihedral(a: float, b: float) -> None:
    wavelength, distance = radar().settings.wavelength, 30.0
    dihedral = 8 * math.pi * (a * b / wavelength) ** 2
    expected = db(dihedral * echo_of_walls(INDEX, math.pi / 4))
    found = cross_section_of_tones(corner_of(a, b, distance, 0, SMOOTH), distance)
    assert found == pytest.approx(expected, abs=1)


def test_slopes_of_walls_spread_the_echo_beyond_a_narrow_beam() -> None:
    """Two walls of slope s: a lobe of s sqrt(2) off the line, and of s along it."""
    narrow, slope = math.radians(12) / (4 * math.sqrt(math.log(2))), math.radians(2)
    ratio = 1 / math.hypot(1, math.sqrt(2) * slope / narrow)
    ratio /= math.hypot(1, slope / narrow)
    found = cross_section_of_tones(corner_of(6, 9, 20.0, 0, CONCRETE), 20.0)
    smooth = cross_section_of_tones(corner_of(6, 9, 20.0, 0, SMOOTH), 20.0)
    assert found - smooth == pytest.approx(db(ratio), abs=0.5)


def test_wall_on_a_floor_returns_from_its_foot() -> None:
    """The way goes down to the floor, and on to the wall, 10 m away and 1 m lower."""
    floor = block((20, 40, 0.2), (5, 0, -0.1), SMOOTH)
    wall = block((0.2, 40, 6), (10.1, 0, 3), SMOOTH)
    distance = math.hypot(10, EYE.z)
    index_angle = math.atan2(10, EYE.z)  # on the floor
    expected = db(math.pi * distance**2 * echo_of_walls(INDEX, index_angle))
    both = scene_of(floor, wall)
    points = corner_points(tracer_of(both), np.array([0, 0, EYE.z]), radar().settings)
    assert points.positions == pytest.approx(np.array([[10, 0, 0]]), abs=0.01)
    assert db(points.rcs[0]) == pytest.approx(expected, abs=0.5)
    assert not len(corner_points(tracer_of(scene_of(wall)), EYE_AT, PLAIN).rcs)


def test_corner_behind_a_wall_is_not_seen() -> None:
    corner = corner_of(2, 3, 20.0, 0, SMOOTH)
    screen = block((0.2, 6, 6), (15, 0, 0))
    assert not len(tones_of(scene_of(*corner.parts, screen)).power)


def test_outside_of_a_corner_returns_nothing() -> None:
    """A box shows its edge, at which no wave goes from one side to the other."""
    vertices, faces = box(2, 2, 3)
    turned = vertices @ rotation_matrix(0, 0, math.pi / 4).T + [20, 0, EYE.z]
    scene = scene_of(Part("box", SMOOTH, turned, faces))
    assert not len(corner_points(tracer_of(scene), EYE_AT, PLAIN).rcs)


def test_order_of_walls_is_irrelevant() -> None:
    parts = corner_of(2, 3, 20.0, 10, CONCRETE).parts
    one, other = scene_of(*parts), scene_of(*reversed(parts))
    found = [corner_points(tracer_of(each), EYE_AT, PLAIN) for each in (one, other)]
    assert found[0].rcs == pytest.approx(found[1].rcs, rel=1e-12)
    assert found[0].positions == pytest.approx(found[1].positions, abs=1e-9)


def test_walls_that_are_not_at_right_angles_send_the_wave_elsewhere() -> None:
    scene = corner_of(0.1, 0.1, 30.0)
    first, second = scene.parts
    turn = rotation_matrix(0, 0, math.radians(6))
    middle = np.array([30.0, 0, 0])
    opened = Part(
        "first", METAL, (first.vertices - middle) @ turn.T + middle, first.faces
    )
    assert cross_section(scene_of(opened, second), 30.0) < -20
