import pytest

from radarsim.benchmark.engine import KINDS, beams_against_rays
from radarsim.geometry import Pose3
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.scene.scene import Scene
from radarsim.sensors.range_scanner import load_sensor

MARGIN = 1.5  # machines are noisy; what is lost by a change is more than that


@pytest.mark.parametrize("name", list(KINDS))
def test_the_number_of_rays_is_that_of_the_settings(name: str) -> None:
    settings, rays = KINDS[name]
    sensor = load_sensor("radar", fov_deg=2, **settings)
    tracer = tracer_of(Scene("empty", "Empty", ()))
    plan = sensor.plan(tracer, Pose3(0, 0, 0), generator_for(0))
    assert len(plan.rays.max_range) == 3 * rays


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_many_rays_cost_no_more_than_as_many_scans() -> None:
    for _ in range(3):  # a neighbour's work is no regression
        rows = list(beams_against_rays(1.0))
        missed = [row for row in rows if row.limit and row.value > row.limit * MARGIN]
        if not missed:
            break
    assert not missed
