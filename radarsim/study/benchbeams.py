"""Benchmarks of beams with many rays and many echoes: row g."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from radarsim.randomness import generator_for
from radarsim.sensors.range_scanner import load_sensor, sensor_pose
from radarsim.study.benchrows import Row
from radarsim.study.benchscenes import SENSOR, foliage_wall
from radarsim.study.timing import compare

STEP = {"resolution_deg": 0.5}  # 361 beams
CONE = {"side_mode": "cone", "beamwidth_az_deg": 2, "beamwidth_el_deg": 2}
# What is measured, its settings, and how many rays a beam has.
KINDS: dict[str, tuple[dict[str, Any], int]] = {
    "echoes of the drawn ray": ({"return_mode": "all", "ray_choice": "drawn"}, 1),
    "echoes of all three rays": ({"return_mode": "all"}, 3),
    "incidence weights": ({"incidence_weights": True}, 3),
    "cone of 16": ({**CONE, "cone_rays": 16, "ray_choice": "together"}, 16),
    "cone of 16 random rays": (
        {
            **CONE,
            "cone_rays": 16,
            "ray_choice": "together",
            "cone_sampling": "random",
        },
        16,
    ),
}


PLAIN = {"return_mode": "last", "incidence_weights": False, "ray_choice": "drawn"}


def beams_against_rays(seconds: float) -> Iterator[Row]:
    """Measure scans of many rays by as many scans that each draw one of these rays."""
    scene = foliage_wall()
    pose, rng = sensor_pose(scene, SENSOR), generator_for(0, "bench")
    for name, (settings, rays) in KINDS.items():
        sensor = load_sensor("radar", **STEP, **settings)
        plain = load_sensor("radar", **STEP, **{**settings, **PLAIN})
        draw = partial(plain.scan, scene, pose, rng)
        result = compare(
            partial(sensor.scan, scene, pose, rng),
            partial(_repeat, draw, rays),
            seconds=seconds,
        )
        note = f"{result.subject * 1e6:.0f} us against {result.reference * 1e6:.0f}"
        yield Row("g", name, result.ratio, "x", 1.0 if rays > 1 else None, note)


def _repeat(run: Callable[[], object], times: int) -> None:
    for _ in range(times):
        run()
