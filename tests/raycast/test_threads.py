"""Rays that are traced on several threads end as on one."""

from typing import Any

import numpy as np
import pytest

from radarsim.errors import EngineError
from radarsim.processes import process_cpu_count, thread_count
from radarsim.raycast import tracer as tracer_module
from radarsim.raycast.rays import Boxes, Rays, Traces
from radarsim.raycast.tracer import Tracer, tracer_of
from radarsim.scene.scene import Scene

ROBOTS = Boxes(np.array([[2.0, 1, 0.3, 0, 1, 0.4, 0.3, i] for i in range(9)]))


def rays_in_room(count: int) -> Rays:
    rng = np.random.Generator(np.random.PCG64(count))
    starts = rng.uniform([-8, -4, 0.3], [8, 4, 0.4], (count, 3))
    angles = rng.uniform(-np.pi, np.pi, count)
    ways = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(count)])
    return Rays.uniform(starts, ways, max_range=20.0, power=2.0)


def columns(traces: Traces) -> list[bytes]:
    return [column.tobytes() for column in traces]


@pytest.mark.parametrize("threads", [2, 3, 16])
@pytest.mark.parametrize("count", [1, 5, 3000])
@pytest.mark.parametrize("wanted", [{}, {"events": True, "incidence": True}])
def test_traces_are_the_same_for_any_number_of_threads(
    threads: int,
    count: int,
    wanted: dict[str, Any],
    foliage_room: Scene,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rays, tracer = rays_in_room(count), tracer_of(foliage_room)
    monkeypatch.setattr(tracer_module, "RAYS_PER_THREAD", 1)
    monkeypatch.setattr(tracer_module, "thread_count", lambda: 1)
    expected = columns(tracer.trace(rays, ROBOTS, **wanted))
    monkeypatch.setattr(tracer_module, "thread_count", lambda: threads)
    assert columns(tracer.trace(rays, ROBOTS, **wanted)) == expected
    # Also where the surfaces of a segment need more room than there is at first.
    monkeypatch.setattr(tracer_module, "INITIAL_CAPACITY", 1)
    fresh = Tracer(foliage_room.parts)
    assert columns(fresh.trace(rays, ROBOTS, **wanted)) == expected


@pytest.mark.parametrize("threads", [1, 2, 7])
def test_the_first_invalid_ray_is_named(
    threads: int, foliage_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    rays = rays_in_room(4000)
    rays.power[[700, 2100, 3999]] = -1.0
    monkeypatch.setattr(tracer_module, "RAYS_PER_THREAD", 500)
    monkeypatch.setattr(tracer_module, "thread_count", lambda: threads)
    with pytest.raises(EngineError, match=r"^ray 700 from .* power -1.0, class"):
        tracer_of(foliage_room).trace(rays)


@pytest.mark.parametrize(
    ("limit", "expected"), [("1", 1), ("0", 1), ("999", None), ("", None), ("x", None)]
)
def test_threads_are_limited_by_the_environment(
    limit: str, expected: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", limit)
    assert thread_count() == (expected or process_cpu_count())
