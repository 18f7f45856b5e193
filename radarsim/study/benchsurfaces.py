"""Benchmarks of mirrors and of leaves: row h."""

import math
from collections.abc import Iterator
from functools import partial

from radarsim.plants.scenes import leaf_scene
from radarsim.randomness import generator_for
from radarsim.raycast.embree import FirstHits, Mesh
from radarsim.raycast.tracers import tracer_of
from radarsim.sensors.range_scanner import load_sensor, sensor_pose
from radarsim.study.benchrows import Row
from radarsim.study.benchscenes import SENSOR, hall_of_mirrors
from radarsim.study.timing import compare

STEP = {"resolution_deg": 0.5}  # 361 beams
BOUNCES = 2
TRIANGLES = 1_000_000


def mirrors_and_leaves(seconds: float) -> Iterator[Row]:
    """Measure rays of three legs, and rays through single leaves."""
    yield _mirrors(seconds)
    yield _leaves(seconds)


def _mirrors(seconds: float) -> Row:
    """Measure rays that two mirrors turn round by rays that end at the first.

    Their power is unlimited, so that none ends in the foliage.
    """
    scene = hall_of_mirrors()
    pose, rng = sensor_pose(scene, SENSOR), generator_for(0, "bench")
    turned, plain = (
        load_sensor("radar", **STEP, max_bounces=bounces, penetration_power=math.inf)
        for bounces in (BOUNCES, 0)
    )
    result = compare(
        partial(turned.scan, scene, pose, rng),
        partial(plain.scan, scene, pose, rng),
        seconds=seconds,
    )
    note = f"{result.subject * 1e6:.0f} us against {result.reference * 1e6:.0f}"
    name = f"{BOUNCES} bounces in a hall of mirrors, by none"
    return Row("h", name, result.ratio, "x", BOUNCES + 1.0, note)


def _leaves(seconds: float) -> Row:
    scene = leaf_scene(TRIANGLES)
    pose, rng = sensor_pose(scene, SENSOR), generator_for(0, "bench")
    radar = load_sensor("radar", **STEP)
    rays = radar.plan(tracer_of(scene), pose, rng).rays
    meshes = [Mesh(part.vertices, part.faces) for part in scene.parts]
    first = FirstHits(meshes, rays.origins, rays.directions)
    result = compare(partial(radar.scan, scene, pose, rng), first.run, seconds=seconds)
    note = f"{result.subject * 1e6:.0f} us against {result.reference * 1e6:.0f}"
    name = f"leaves of {scene.triangles} triangles, by one raw first-hit call"
    return Row("h", name, result.ratio, "x", None, note)
