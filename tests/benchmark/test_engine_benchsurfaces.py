import math

import numpy as np
import pytest

from radarsim.benchmark.engine import mirrors_and_leaves
from radarsim.benchmark.scenes import SENSOR, hall_of_mirrors
from radarsim.raycast.attenuation import EventKind
from radarsim.raycast.tracer import tracer_of
from radarsim.sensors.range_scanner import load_sensor, sensor_pose

MARGIN = 1.5


def test_rays_in_the_hall_are_mirrored_as_often_as_they_may_be() -> None:
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
@pytest.mark.timeout(300)
def test_each_leg_costs_no_more_than_a_ray() -> None:
    for _ in range(3):  # a neighbour's work is no regression
        mirrors, leaves = mirrors_and_leaves(1.0)
        assert mirrors.limit is not None
        if mirrors.value <= mirrors.limit * MARGIN and leaves.value < 12:
            return
    pytest.fail(f"{mirrors}, {leaves}")
