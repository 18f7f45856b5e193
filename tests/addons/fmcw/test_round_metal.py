"""Posts, spheres and other round things of metal."""

import math

import numpy as np
import pytest
from fmcw_scenes import EYE, block, db, radar, received_power, scene_of

import radarsim
from radarsim.addons.fmcw.round_metal import round_parts, round_points
from radarsim.geometry import Floats, rotation_matrix
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.material import library_material
from radarsim.scene.scene import Part
from radarsim.scene.shapes import Mesh, cylinder, sphere

METAL = library_material("metal")
WIDE = radar(beamwidth_az_deg=12, beamwidth_el_deg=12)
WAVE = 2 * math.pi / WIDE.settings.wavelength


def part_at(distance: float, mesh: Mesh, yaw_deg: float = 0.0) -> Part:
    """Return a thing of metal straight ahead of ``EYE``, turned about the vertical."""
    vertices, faces = mesh
    turned = vertices @ rotation_matrix(0, 0, math.radians(yaw_deg)).T
    return Part("thing", METAL, turned + np.array([distance, 0, EYE.z]), faces)


def cross_section(part: Part, distance: float) -> float:
    """Return the cross section of an object at a distance, dBsm, by a spectrum."""
    turn = WIDE.spectrum(scene_of(part), EYE, radarsim.generator_for(0))
    near = np.abs(turn.ranges - distance) < 1
    unit = received_power(WIDE.settings, 1.0, distance)
    return float(db(turn.echo_power[0, near].sum() / unit))


def optics_of_a_post(radius: float, height: float, distance: float) -> float:
    """Return the cross section of a post by physical optics, spherical waves, dBsm.

    4 pi / lambda^2 |integral of n e^(2 i k r) dS|^2 over what the wave lights; Knott,
    Radar Cross Section, chapter 5. The distance is that of its surface.
    """
    angles = (np.arange(4000) + 0.5) * math.pi / 4000 - math.pi / 2
    up = ((np.arange(600) + 0.5) / 600 - 0.5)[:, None] * height
    ahead = distance + radius * (1 - np.cos(angles))
    way = np.sqrt(ahead**2 + (radius * np.sin(angles)) ** 2 + up**2)
    cosine = np.cos(angles) * distance / way
    field = (cosine * np.exp(2j * WAVE * way) * (distance / way) ** 2).sum()
    field *= radius * math.pi / 4000 * height / 600
    return float(db(WAVE**2 / math.pi * abs(field) ** 2))


@pytest.mark.parametrize(
    ("radius", "distance"), [(0.1, 20.0), (0.5, 60.0), (1.0, 90.0)]
)
@pytest.mark.parametrize("yaw_deg", [0.0, 13.7])
def test_sphere_returns_pi_r_squared(
    radius: float, distance: float, yaw_deg: float
) -> None:
    """Geometrical optics; Knott, Radar Cross Section, chapter 3."""
    found = cross_section(part_at(distance, sphere(radius), yaw_deg), distance - radius)
    assert found == pytest.approx(db(math.pi * radius**2), abs=0.5)


# At 2.8125 degrees a side of the mesh faces the antenna, at 0 an edge.
@pytest.mark.parametrize("yaw_deg", [0.0, 1.0, 2.8125])
@pytest.mark.parametrize(
    ("radius", "height", "distance"),
    [(0.05, 0.3, 100.0), (0.05, 2.0, 20.0), (0.2, 3.0, 50.0), (0.1, 0.4, 30.0)],
)
def test_post_returns_by_physical_optics(
    radius: float, height: float, distance: float, yaw_deg: float
) -> None:
    mesh = cylinder(radius, height)
    found = cross_section(part_at(distance + radius, mesh, yaw_deg), distance)
    expected = optics_of_a_post(radius, height, distance)
    assert found == pytest.approx(expected, abs=0.7)
    if 2 * height**2 < WIDE.settings.wavelength * distance:
        far = db(WAVE * radius * height**2)  # 2 pi r L^2 / lambda, the textbook's
        assert found == pytest.approx(far, abs=0.5)


def section_along(mesh: Mesh, eye: Floats) -> float:
    """Return the cross section of a thing of metal at the origin, m^2."""
    tracer = tracer_of(scene_of(Part("thing", METAL, *mesh)))
    return float(round_points(tracer, eye, WIDE.settings.wavelength).rcs.sum())


def test_post_that_lies_returns_as_one_that_stands() -> None:
    vertices, faces = cylinder(0.05, 0.3)
    lying = vertices @ rotation_matrix(0.4, 1.2, 0.3).T, faces
    eye = np.array([100.0, 0, 0]) @ rotation_matrix(0.4, 1.2, 0.3).T
    standing = section_along((vertices, faces), np.array([100.0, 0, 0]))
    assert section_along(lying, eye) == pytest.approx(standing, rel=1e-3)


def test_egg_returns_by_both_of_its_curvatures() -> None:
    """pi r1 r2 = pi a^2 b^2 / c^2 at the end of an axis c of an ellipsoid."""
    vertices, faces = sphere(1.0)
    found = section_along((vertices * [0.2, 0.3, 0.5], faces), np.array([500.0, 0, 0]))
    assert db(found / (math.pi * (0.3 * 0.5 / 0.2) ** 2)) == pytest.approx(0, abs=0.7)


def test_box_is_flat_and_what_is_seen_from_inside_returns_nothing() -> None:
    flat = tracer_of(scene_of(block((1, 1, 1), (9, 0, 1), METAL)))
    assert round_parts(flat).tolist() == [False]
    assert section_along(sphere(1.0), np.zeros(3)) == 0.0
