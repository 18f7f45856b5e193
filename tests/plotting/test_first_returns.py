"""How pictures show beams that answer inside smoke."""

import numpy as np
import pytest

import radarsim
from radarsim.plotting.sight import BeamEnd, find_sight, name_materials


@pytest.mark.parametrize("quantum", [0.0, 0.5])
def test_beams_that_answer_in_smoke_are_stopped_by_it(quantum: float) -> None:
    """The wall or the end of its power can be nearer to an answer than the edge."""
    scene = radarsim.load_map("smoke_room")
    laser = radarsim.load_sensor("physical", range_quantum=quantum)
    scan = laser.scan(scene, (-9.8, 0, 0), 1)  # where the wall is in the smoke, too
    sight = find_sight(scene, scan)
    answered = scan.ranges > 0
    assert np.unique(sight.ends[answered]).tolist() == [BeamEnd.STOPPED]
    assert name_materials(sight.materials[BeamEnd.STOPPED]) == "smoke"
