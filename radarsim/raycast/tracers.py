"""One tracer for each scene: built when first asked for, kept as long as the scene."""

from weakref import WeakKeyDictionary

from radarsim.raycast.tracer import Tracer
from radarsim.scene.scene import Scene

_tracers: WeakKeyDictionary[Scene, Tracer] = WeakKeyDictionary()


def tracer_of(scene: Scene) -> Tracer:
    """Give the tracer of a scene.

    Raises:
        EngineError: If Embree cannot take a part of the scene.
    """
    tracer = _tracers.get(scene)
    if tracer is None:
        tracer = _tracers[scene] = Tracer(scene.parts)
    return tracer
