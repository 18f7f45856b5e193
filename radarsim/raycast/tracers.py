"""One tracer for each scene: built when first asked for, kept as long as the scene."""

import functools
from weakref import WeakKeyDictionary

import numpy as np

from radarsim.errors import EngineError
from radarsim.raycast.rays import Rays, Traces
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.scene.shapes import box

_tracers: WeakKeyDictionary[Scene, Tracer] = WeakKeyDictionary()


def tracer_of(scene: Scene) -> Tracer:
    """Give the tracer of a scene.

    Raises:
        EngineError: If Embree cannot be used, or cannot take a part of the scene.
    """
    tracer = _tracers.get(scene)
    if tracer is None:
        _see_that_rays_end_right()
        tracer = _tracers[scene] = Tracer(scene.parts, scene.air)
    return tracer


@functools.cache
def _see_that_rays_end_right() -> None:
    """Cast a ray through half a metre of hedge to a wall, once in a process.

    Embree does not tell the sizes of its structures. This shows that it has those that
    are filled in for it.
    """
    vertices, faces = box(0.5, 1.0, 1.0)
    near, far = vertices + np.array([1, 0, 0]), vertices + np.array([3.25, 0, 0])
    hedge = Part("hedge", Material("hedge", density=1.0), near, faces)
    wall = Part("wall", Material("wall"), far, faces)
    ray = Rays.alike(np.zeros((1, 3)), np.eye(3)[:1], reach=5.0, power=1.0)
    expect_known_end(Tracer([hedge, wall]).trace(ray))


def expect_known_end(traces: Traces) -> None:
    """Refuse an Embree that ends a ray elsewhere than at 3 m, with half its power.

    Raises:
        EngineError: If it does.
    """
    t, power = float(traces.ranges[0]), float(traces.power[0])
    if abs(t - 3.0) > 1e-9 or abs(power - 0.5) > 1e-9:
        raise EngineError(
            f"a ray of known end ends at {t:.6g} m with power {power:.6g}, expected"
            " 3 m and 0.5: this Embree is laid out otherwise than version 4.4"
        )
