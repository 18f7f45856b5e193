"""Points by their sidelobes, in mirrors and over ground, and the edges of plates."""

import math
from dataclasses import replace

import numpy as np
import pytest
from fmcw_scenes import (
    EYE,
    beat_spectrum,
    block,
    db,
    no_echoes,
    radar,
    received_power,
    scene_of,
)

import radarsim
from radarsim.addons.fmcw.antenna import fixed_viewpoints
from radarsim.addons.fmcw.corners_and_edges import edge_points
from radarsim.addons.fmcw.point_echoes import fresnel_reflections
from radarsim.addons.fmcw.radar import FmcwRadar
from radarsim.geometry import Floats, rotation_matrix
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.material import library_material
from radarsim.scene.scene import Part, Reflector, Scene
from radarsim.scene.shapes import box

METAL = library_material("metal")


def corner_at(x: float, y: float, z: float = EYE.z) -> Reflector:
    return Reflector("corner", (x, y, z), rcs_dbsm=30)


def received(which: FmcwRadar, corner: Reflector, *parts: Part) -> Floats:
    """Return the echo power of each direction and bin, W."""
    scene = Scene("points", "Points", parts, reflectors=(corner,))
    turn = which.spectrum(scene, EYE, radarsim.generator_for(0))
    return np.asarray(turn.echo_power, np.float64)


def pane_at(distance: float, degrees: float, size: tuple[float, float, float]) -> Part:
    """Return a plate of metal ahead of ``EYE``, turned about the vertical."""
    vertices, faces = box(*size)
    turned = vertices @ rotation_matrix(0, 0, math.radians(degrees)).T
    return Part("pane", METAL, turned + np.array([distance, 0, EYE.z]), faces)


def ground(material: radarsim.Material) -> Part:
    return block((800, 800, 0.2), (0.0, 0.0, -0.1), material)


def field_ahead(which: FmcwRadar, corner: Reflector, *parts: Part) -> complex:
    """Return the field of the tones straight ahead, as if all were in one bin."""
    scene = Scene("points", "Points", parts, reflectors=(corner,))
    view = fixed_viewpoints(EYE, which.times(0)[:1])
    tones = which.tones(scene, view, range(1))
    return complex((np.sqrt(tones.power) * np.exp(1j * tones.phases)).sum())


@pytest.mark.parametrize("degrees", [9, 45, 180])
def test_sidelobes_of_a_point_are_at_their_level(degrees: float) -> None:
    which = radar(bins=800, sidelobe_db=-70)
    power = received(which, corner_at(20, 0)).sum(axis=1)
    found = db(power[round(degrees / 0.9)] / power[0])
    assert found == pytest.approx(-70, abs=0.05)


def test_point_in_a_mirror_is_where_its_image_is() -> None:
    """A mirror at 45 degrees, 10 m ahead, and a point 5 m to the side of that."""
    pane = pane_at(10, 45, (0.01, 6, 6))
    which = radar(bins=800)
    ahead = received(which, corner_at(10, -5), pane)[0]
    near = np.abs(which.ranges - 15) < 0.2
    expected = received_power(which.settings, 1e3, 15.0)
    assert db(ahead[near].sum() / expected) == pytest.approx(0, abs=0.1)


@pytest.mark.parametrize("name", ["metal", "concrete"])
def test_point_over_level_ground_has_lobes(name: str) -> None:
    """The field is that of the point times (1 + G e^(-i k d))^2 of both ways."""
    which = radar(beamwidth_el_deg=45)
    material = library_material(name)
    wave = 2 * math.pi / which.settings.wavelength
    gains = []
    for height in np.linspace(0.9, 1.1, 41).tolist():
        corner = corner_at(30, 0, height)
        found = field_ahead(which, corner, ground(material))
        gains.append(db(abs(found / field_ahead(which, corner)) ** 2))
        straight = math.hypot(30, height - EYE.z)
        mirrored = math.hypot(30, height + EYE.z)
        head_on = 10 ** ((material.specular_db or 0) / 10)
        across, along = fresnel_reflections(
            np.array(head_on), np.array((height + EYE.z) / mirrored)
        )
        root = -1.0 if name == "metal" else -math.sqrt(float(across + along) / 2)
        both = root * straight / mirrored * np.exp(-1j * wave * (mirrored - straight))
        expected = db(abs(1 + both) ** 4)
        if expected > -15:  # in the nulls a small error is many decibels
            assert gains[-1] == pytest.approx(expected, abs=0.5)
    highest = 12 if name == "metal" else 10
    assert max(gains) == pytest.approx(highest, abs=1)
    assert min(gains) < -10


def test_lobes_over_metal_show_in_a_spectrum() -> None:
    """Of 25 heights, where the direct and the reflected way do not cancel."""
    which = radar(beamwidth_el_deg=45, azimuths=4)
    settings, view = which.settings, fixed_viewpoints(EYE, which.times(0)[:1])
    wave, errors = 2 * math.pi / settings.wavelength, []
    for height in np.linspace(0.9, 1.1, 25).tolist():
        powers = []
        for parts in ((), (ground(METAL),)):
            corner = replace(corner_at(30, 0, height), rcs_dbsm=60)
            scene = Scene("points", "Points", parts, reflectors=(corner,))
            tones = which.tones(scene, view, range(1))
            seed = radarsim.generator_for(0)
            quiet = no_echoes(settings)[:1]
            powers.append(beat_spectrum(settings, quiet, tones, seed).max())
        straight, mirrored = (math.hypot(30, height + k * EYE.z) for k in (-1, 1))
        both = straight / mirrored * np.exp(1j * wave * (mirrored - straight))
        expected = db(abs(1 - both) ** 4)
        if expected > -10:
            errors.append(db(powers[1] / powers[0]) - expected)
    assert len(errors) > 15
    assert math.sqrt(np.mean(np.square(errors))) < 0.3


def test_fresnel_reflection_of_glass() -> None:
    """By the refractive index 1.5: 4 % head-on, all at grazing, textbooks' 60 deg."""
    index, cosine = 1.5, 0.5
    inner = math.sqrt(1 - (1 - cosine**2) / index**2)
    across = (cosine - index * inner) / (cosine + index * inner)
    along = (index * cosine - inner) / (index * cosine + inner)
    found = fresnel_reflections(np.array([0.04] * 3), np.array([1.0, cosine, 1e-6]))
    assert found[0] == pytest.approx([0.04, across**2, 1], abs=1e-4)
    assert found[1] == pytest.approx([0.04, along**2, 1], abs=1e-4)


def optics_of_a_plate(side: float, distance: float, angle: float, wave: float) -> float:
    """Return the cross section of a plate by physical optics, spherical waves, m^2."""
    cells = np.linspace(-side / 2, side / 2, 1501)
    middle = (cells[1:] + cells[:-1]) / 2
    x, y = distance + middle * math.sin(angle), middle * math.cos(angle)
    # Up and down the phase is that of the height alone, at this distance.
    across = np.exp(2j * wave * np.hypot(x, y)).mean() * side
    upright = np.exp(1j * wave * middle**2 / distance).mean() * side
    return float(wave**2 / math.pi * abs(across * upright) ** 2 * math.cos(angle) ** 2)


@pytest.mark.parametrize("distance", [20.0, 400.0])
def test_plate_off_its_glint_returns_by_its_edges(distance: float) -> None:
    side, wavelength = 0.5, radar().settings.wavelength
    wave = 2 * math.pi / wavelength
    found, expected = [], []
    for degrees in np.linspace(4.5, 5.5, 41).tolist():
        scene = scene_of(pane_at(distance, degrees, (0.004, side, side)))
        points = edge_points(tracer_of(scene), EYE.position(), wavelength)
        found.append(points.rcs.sum())
        expected.append(optics_of_a_plate(side, distance, math.radians(degrees), wave))
    assert db(np.mean(found) / np.mean(expected)) == pytest.approx(0, abs=0.7)
    if distance > 127:  # the far field: a^2 / (2 pi tan^2 theta), 7.2 dBsm
        assert db(np.mean(found)) == pytest.approx(7.2, abs=0.4)


def test_edges_of_a_plate_show_in_a_spectrum() -> None:
    scene = scene_of(pane_at(20, 5, (0.004, 0.5, 0.5)))
    which = radar(bins=800, beamwidth_az_deg=20)
    turn = which.spectrum(scene, EYE, radarsim.generator_for(0))
    power = turn.echo_power[0].sum()
    per_metre = received_power(which.settings, 1.0, 20.0)
    assert db(power / per_metre) == pytest.approx(-2.8, abs=1)
