import gc
import weakref

import numpy as np
import pytest

from radarsim.errors import EngineError
from radarsim.raycast.attenuation import EVENT
from radarsim.raycast.rays import Traces
from radarsim.raycast.tracer import expect_known_end, tracer_of
from radarsim.scene.scene import Scene


def test_a_scene_has_one_tracer() -> None:
    scene, other = Scene("one", "DM-One"), Scene("one", "DM-One")
    assert tracer_of(scene) is tracer_of(scene)
    assert tracer_of(scene) is not tracer_of(other)


def test_a_tracer_goes_with_its_scene() -> None:
    scene = Scene("one", "DM-One")
    tracer = weakref.ref(tracer_of(scene))
    del scene
    gc.collect()
    assert tracer() is None


@pytest.mark.parametrize(("t", "power"), [(np.inf, 1.0), (3.0, 1.0), (2.9, 0.5)])
def test_an_embree_of_another_layout_is_refused(t: float, power: float) -> None:
    wrong = Traces(
        np.array([t]),
        np.zeros(1, np.uint8),
        np.zeros(1, np.int64),
        np.array([power]),
        np.zeros(0),
        np.zeros(0, EVENT),
    )
    with pytest.raises(EngineError) as caught:
        expect_known_end(wrong)
    assert str(caught.value) == (
        f"a ray of known end ends at {t:.6g} m with power {power:.6g}, expected"
        " 3 m and 0.5: this Embree is laid out otherwise than version 4.4"
    )
