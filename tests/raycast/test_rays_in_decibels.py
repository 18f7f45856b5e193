"""Rays of a radar that counts in decibels, against sums of decibels."""

import math

import pytest
from parts import layer, rays_ahead

from radarsim.raycast.rays import LASER, RADAR, Outcome, RayClass, Traces
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import Material
from radarsim.scene.scene import Part

# 1 of power is 25 dB one way, as for a margin of 50 dB; the rays start with 75 dB
PER_DB = 1 / 25
IN_UNITS = RayClass(RADAR, 1, PER_DB)
IN_DECIBELS = RayClass(RADAR, 1, PER_DB, is_absorbed=False, in_decibels=True)
LEAVES = Material("leaves", density=0.7, attenuation_db=(2.0, 3.0, 4.0))
LEAF = Material(
    "leaf", density=0.0, sheet_loss=0.4, sheet_attenuation_db=(0.1, 0.2, 0.3)
)
BUSH = Material("bush", density=0.3, radar_db=(0.0, 1.0, 0.0))
SOIL = Material("soil", absorption_db=math.inf, backscatter_db=-25.0)


def trace(ray_class: RayClass, *parts: Part) -> Traces:
    rays = rays_ahead(power=3.0, ray_classes=(ray_class,))
    return Tracer(parts).trace(rays, incidence=True)


@pytest.mark.parametrize(
    ("ray_class", "material", "lost"),
    [
        (IN_DECIBELS, LEAVES, 2 * 3.0),
        (IN_UNITS, LEAVES, 2 * 0.7 * 25),
        (IN_DECIBELS, LEAF, 2 * 0.2),
        (IN_UNITS, LEAF, 2 * 0.4 * 25),
        # units where there are no decibels
        (IN_DECIBELS, BUSH, 2 * (0.3 * 25 + 1.0)),
        (IN_DECIBELS, Material("leaf", density=0.0, sheet_loss=0.1), 2 * 0.1 * 25),
    ],
)
def test_decibels_of_a_material_apply_instead_of_its_units(
    ray_class: RayClass, material: Material, lost: float
) -> None:
    traces = trace(
        ray_class, layer("m", material, 2, 4), layer("wall", Material("wall"), 9, 10)
    )
    assert traces.outcomes.tolist() == [Outcome.HIT]
    assert (3.0 - traces.power[0]) / PER_DB == pytest.approx(lost)


def test_surface_that_absorbs_in_units_is_hit_in_decibels() -> None:
    assert trace(IN_UNITS, layer("soil", SOIL, 2, 4)).outcomes.tolist() == [
        Outcome.ABSORBED
    ]
    traces = trace(IN_DECIBELS, layer("soil", SOIL, 2, 4))
    assert traces.outcomes.tolist() == [Outcome.HIT]
    assert traces.power.tolist() == [3.0]
    assert traces.incidence.tolist() == [1.0]


def test_light_knows_no_such_decibels() -> None:
    passes = Material("m", 0.7, 0.5, attenuation_db=(2.0, 3.0, 4.0))
    plain, counting = (
        trace(RayClass(LASER, in_decibels=flag), layer("m", passes, 2, 4))
        for flag in (False, True)
    )
    assert plain.power.tolist() == counting.power.tolist() == [pytest.approx(2.0)]
