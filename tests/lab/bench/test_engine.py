import math

import numpy as np
import pytest

from radarsim.geometry import Pose3
from radarsim.lab.bench.engine import (
    LIMITS,
    MULTI_RAY_SENSORS,
    SENSOR,
    beams_against_rays,
    bumpy_room,
    curtains,
    foliage_wall,
    growth,
    hall_of_mirrors,
    mirrors_and_leaves,
    radar_with,
    scans_against_first_hits,
    throughput,
)
from radarsim.raycast.attenuation import EventKind
from radarsim.raycast.rays import Event
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.scene.scene import Scene
from radarsim.sensors.range_scanner import load_sensor, sensor_pose

MARGIN = 1.5  # machines are noisy; what is lost by a change is more than that
SURFACES = (EventKind.ENTER, EventKind.LEAVE)


def crossings(events: list[list[Event]]) -> float:
    return float(np.mean([sum(e.kind in SURFACES for e in ray) for ray in events]))


def test_foliage_wall_has_the_size_that_the_limits_hold_for() -> None:
    scene, radar = foliage_wall(), radar_with(1801)
    rng = np.random.Generator(np.random.PCG64(0))
    tracer = tracer_of(scene)
    plan = radar.plan(tracer, Pose3(-6, 0, 0.346), rng)
    assert scene.triangles == pytest.approx(77_000, rel=0.01)
    assert crossings(tracer.explain(plan.rays)) == pytest.approx(1.7, abs=0.05)


@pytest.mark.parametrize("count", [0, 5, 15])
def test_each_curtain_adds_two_crossings(count: int) -> None:
    scene, radar = curtains(count), radar_with(11)
    rng = np.random.Generator(np.random.PCG64(0))
    tracer = tracer_of(scene)
    plan = radar.plan(tracer, Pose3(-6, 0, 0.346), rng)
    assert crossings([tracer.explain(plan.rays)[5]]) == 2 * count


@pytest.mark.parametrize("triangles", [1000, 100_000])
def test_bumpy_room_has_about_the_requested_triangles(triangles: int) -> None:
    assert bumpy_room(triangles).triangles == pytest.approx(triangles, rel=0.05)


@pytest.mark.slow
def test_scans_keep_their_limits_against_first_hits() -> None:
    for _ in range(3):  # other processes disturb single measurements
        rows = {row.name: row for row in scans_against_first_hits(1.5)}
        scenes = {name.partition(", ")[0] for name in rows}
        assert scenes == LIMITS.keys()
        missed = [row for row in rows.values() if row.value > MARGIN * (row.limit or 0)]
        if not missed:
            break
    assert not missed


@pytest.mark.slow
def test_growth_and_throughput_have_all_their_rows() -> None:
    names = [row.name for row in (*growth(0.01), *throughput(0.05))]
    assert len(names) == len(set(names)) == 4 + 4 + 5 + 2


@pytest.mark.parametrize("name", list(MULTI_RAY_SENSORS))
def test_number_of_rays_follows_from_the_settings(name: str) -> None:
    settings, rays = MULTI_RAY_SENSORS[name]
    sensor = load_sensor("radar", fov_deg=2, **settings)
    tracer = tracer_of(Scene("empty", "Empty", ()))
    plan = sensor.plan(tracer, Pose3(0, 0, 0), generator_for(0))
    assert len(plan.rays.max_range) == 3 * rays


@pytest.mark.slow
def test_many_rays_cost_no_more_than_as_many_scans() -> None:
    for _ in range(3):  # a neighbour's work is no regression
        rows = list(beams_against_rays(1.0))
        missed = [row for row in rows if row.limit and row.value > row.limit * MARGIN]
        if not missed:
            break
    assert not missed


def test_rays_in_the_hall_are_reflected_up_to_the_limit() -> None:
    scene = hall_of_mirrors()
    radar = load_sensor(
        "radar", side_offset_uu=0, max_bounces=2, penetration_power=math.inf
    )
    rng = np.random.Generator(np.random.PCG64(0))
    tracer = tracer_of(scene)
    plan = radar.plan(tracer, sensor_pose(scene, SENSOR), rng)
    events = tracer.trace(plan.rays, events=True).events
    turned = np.bincount(events["ray"][events["kind"] == EventKind.MIRRORED])
    assert turned.max() == 2
    assert (turned > 0).mean() > 0.5


@pytest.mark.slow
def test_each_reflected_segment_costs_no_more_than_a_ray() -> None:
    for _ in range(3):  # a neighbour's work is no regression
        mirrors, leaves = mirrors_and_leaves(1.0)
        assert mirrors.limit is not None
        if mirrors.value <= mirrors.limit * MARGIN and leaves.value < 12:
            return
    pytest.fail(f"{mirrors}, {leaves}")
