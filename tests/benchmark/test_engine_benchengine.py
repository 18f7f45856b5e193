import numpy as np
import pytest

from radarsim.benchmark.engine import (
    LIMITS,
    growth,
    radar_with,
    scans_against_first_hits,
    throughput,
)
from radarsim.benchmark.scenes import bumpy_room, curtains, foliage_wall
from radarsim.geometry import Pose3
from radarsim.raycast.attenuation import EventKind
from radarsim.raycast.rays import Event
from radarsim.raycast.tracer import tracer_of

MARGIN = 1.5  # machines are noisy; what is lost by a change is more than that
SURFACES = (EventKind.ENTER, EventKind.LEAVE)


def crossings(events: list[list[Event]]) -> float:
    return float(np.mean([sum(e.kind in SURFACES for e in ray) for ray in events]))


def test_the_foliage_wall_is_the_one_that_the_limits_are_for() -> None:
    scene, radar = foliage_wall(), radar_with(1801)
    rng = np.random.Generator(np.random.PCG64(0))
    tracer = tracer_of(scene)
    plan = radar.plan(tracer, Pose3(-6, 0, 0.346), rng)
    assert scene.triangles == pytest.approx(77_000, rel=0.01)
    assert crossings(tracer.explain(plan.rays)) == pytest.approx(1.7, abs=0.05)


@pytest.mark.parametrize("count", [0, 5, 15])
def test_each_curtain_is_two_crossings(count: int) -> None:
    scene, radar = curtains(count), radar_with(11)
    rng = np.random.Generator(np.random.PCG64(0))
    tracer = tracer_of(scene)
    plan = radar.plan(tracer, Pose3(-6, 0, 0.346), rng)
    assert crossings([tracer.explain(plan.rays)[5]]) == 2 * count


@pytest.mark.parametrize("triangles", [1000, 100_000])
def test_the_bumpy_room_has_the_triangles_asked_for(triangles: int) -> None:
    assert bumpy_room(triangles).triangles == pytest.approx(triangles, rel=0.05)


@pytest.mark.slow
@pytest.mark.timeout(120)
def test_scans_take_no_more_first_hit_calls_than_they_may() -> None:
    rows = {row.name: row for row in scans_against_first_hits(1.5)}
    for name, limit in LIMITS.items():
        row = rows[f"foliage_wall, {name}"]
        assert row.limit == limit
        assert row.value < MARGIN * limit, row.note


@pytest.mark.slow
@pytest.mark.timeout(120)
def test_growth_and_throughput_have_figures_for_all_they_name() -> None:
    names = [row.name for row in (*growth(0.01), *throughput(0.05))]
    assert len(names) == len(set(names)) == 4 + 4 + 5 + 5 + 2
