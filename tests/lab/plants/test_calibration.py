"""Transmission against closed forms, and calibration."""

from itertools import pairwise

import numpy as np
import pytest

from radarsim.generators.plants.plant import SHAPES
from radarsim.generators.plants.species import SHRUB
from radarsim.lab.plants import (
    Comparison,
    bundle,
    calibrate,
    compare_shapes,
    foliage_material,
    target_transmission,
    transmission,
    transmission_of_ball,
)
from radarsim.raycast.rays import Rays
from radarsim.rng import generator_for
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.scene.shapes import box, cylinder, sphere

CENTRE = np.array([3.0, -2.0, 1.0])
FACETS = 0.012  # relative error, since faces lie inside the true sphere


def rays_at(radius: float, seed: int = 0) -> Rays:
    rng = generator_for(seed, "rays")
    return bundle(CENTRE, radius, rng, azimuths=24, rays=400)


def ball_of(density: float) -> list[Part]:
    vertices, faces = sphere(1.0)
    return [
        Part("ball", Material("foliage", density=density), vertices + CENTRE, faces)
    ]


def test_rays_are_horizontal_and_uniform_over_the_disc_from_all_sides() -> None:
    rays = rays_at(2.0)
    assert np.abs(rays.directions[:, 2]).max() == 0
    assert np.abs(rays.directions.mean(axis=0)).max() < 1e-12
    gaps = CENTRE - rays.origins
    along = np.einsum("ij,ij->i", gaps, rays.directions)
    assert along == pytest.approx(3.0)
    out = np.linalg.norm(gaps - along[:, None] * rays.directions, axis=1)
    shares = [np.mean(out < 2.0 * share**0.5) for share in (0.25, 0.5, 0.75, 1.0)]
    assert shares == pytest.approx([0.25, 0.5, 0.75, 1.0], abs=0.01)
    assert abs(gaps[:, 2].mean()) < 0.01


@pytest.mark.parametrize("density", [0.1, 0.3, 0.5, 0.7, 1.5])
def test_transmission_of_a_bare_ball_agrees_with_its_closed_form(
    density: float,
) -> None:
    measured = transmission(ball_of(density), rays_at(1.0)).mean()
    assert measured == pytest.approx(transmission_of_ball(2 * density), abs=FACETS)


def test_closed_form_is_the_integral_over_the_disc() -> None:
    out = np.sqrt((np.arange(100_000) + 0.5) / 100_000)
    chords = np.sqrt(1 - out**2)
    for opacity in (0.2, 0.999, 1.0, 1.4, 5.0):
        wanted = np.maximum(1 - opacity * chords, 0).mean()
        assert transmission_of_ball(opacity) == pytest.approx(wanted, abs=1e-6)


def test_wood_transmits_nothing() -> None:
    vertices, faces = cylinder(0.5, 4.0)
    part = Part("trunk", Material("wood"), vertices + CENTRE, faces)
    measured = transmission([part], rays_at(1.0))
    assert set(measured.tolist()) == {0.0, 1.0}
    # a bar of half the disc's width covers so much of it
    covered = 2 / np.pi * (np.arcsin(0.5) + 0.5 * np.sqrt(0.75))
    assert measured.mean() == pytest.approx(1 - covered, abs=0.01)


def test_calibration_finds_a_known_density() -> None:
    rays = rays_at(1.0)
    wanted = float(transmission(ball_of(0.42), rays).mean())
    assert calibrate(ball_of, wanted, rays, 5.0) == pytest.approx(0.42, rel=2e-3)


@pytest.mark.parametrize(
    ("most", "opaque"),
    [pytest.param(0.1, False, id="too thin"), pytest.param(5.0, True, id="too thick")],
)
def test_unreachable_transmission_is_refused(most: float, opaque: bool) -> None:
    def parts(loss: float) -> list[Part]:
        vertices, faces = box(9, 9, 9)
        wall = [Part("wall", Material("wall"), vertices + CENTRE, faces)]
        return wall if opaque else ball_of(loss)

    with pytest.raises(ValueError, match=r"expected 0\.2000 between"):
        calibrate(parts, 0.2, rays_at(1.0), most)


@pytest.fixture(scope="module")
def compared() -> list[Comparison]:
    return list(compare_shapes(2, rays=400, azimuths=48))


def test_all_shapes_of_a_shrub_have_the_same_transmission(
    compared: list[Comparison],
) -> None:
    assert [each.shape for each in compared] == list(SHAPES)
    for each in compared:
        assert each.transmission == pytest.approx(target_transmission(), rel=0.03)
    assert target_transmission(SHRUB) == pytest.approx(1 / (3 * 1.4**2))


def test_finer_shapes_spread_the_points_where_rays_are_spent(
    compared: list[Comparison],
) -> None:
    spreads = [each.ranges.statistics() for each in compared]
    for coarse, fine in pairwise(spreads):
        assert fine.spent > 1.5 * coarse.spent


def test_title_has_the_loss_of_the_foliage(compared: list[Comparison]) -> None:
    ball, _, leaves = (each.title for each in compared)
    assert ball == f"ball, takes {compared[0].foliage.density} per metre"
    assert leaves == f"leaves, each takes {compared[2].foliage.sheet_loss}"


def test_leaves_are_sheets_and_the_other_shapes_volumes() -> None:
    materials = [foliage_material(shape, 0.3) for shape in SHAPES]
    assert [each.sheet_loss for each in materials] == [None, None, 0.3]
    assert [each.density for each in materials] == [0.3, 0.3, 0.0]
