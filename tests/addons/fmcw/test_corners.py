"""What comes back by two mirrors at right angles."""

import math

import numpy as np
import pytest
from fmcw_scenes import EYE, db, echo_power, radar, scene_of

from radarsim.addons.fmcw.radar_equation import received_power
from radarsim.geometry import rotation_matrix
from radarsim.scene.material import Material, library_material
from radarsim.scene.scene import Part, Scene
from radarsim.scene.shapes import box

THICK = 0.01  # m
METAL = library_material("metal")


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
    """Return the cross section of what is straight ahead, dBsm."""
    which = radar(bins=1000, beamwidth_az_deg=beam_deg, beamwidth_el_deg=beam_deg)
    power = echo_power(which, scene)[0]
    near = np.abs(which.ranges - distance) < 1
    return float(db(power[near].sum() / received_power(which.settings, 1.0, distance)))


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


def test_corner_of_large_walls_returns_as_a_mirror_of_metal() -> None:
    """Walls of 2 x 3 m at 20 m are larger than what takes part: pi R^2."""
    # The slopes of both walls make a lobe that a narrow beam cuts off.
    found = cross_section(corner_of(2, 3, 20.0), 20.0, beam_deg=12)
    assert found == pytest.approx(db(math.pi * 20**2), abs=1.5)


def test_walls_that_are_not_at_right_angles_send_the_wave_elsewhere() -> None:
    scene = corner_of(0.1, 0.1, 30.0)
    first, second = scene.parts
    turn = rotation_matrix(0, 0, math.radians(6))
    middle = np.array([30.0, 0, 0])
    opened = Part(
        "first", METAL, (first.vertices - middle) @ turn.T + middle, first.faces
    )
    assert cross_section(scene_of(opened, second), 30.0) < -20
