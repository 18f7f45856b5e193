"""How pictures show beams that answer inside smoke."""

import numpy as np

import radarsim
from radarsim.plotting.sight import BeamEnd, find_sight


def test_beams_that_answer_in_smoke_are_stopped_by_it() -> None:
    """The wall or the end of its power can be nearer to an answer than the edge."""
    scene = radarsim.load_map("smoke_room")
    scan = radarsim.load_sensor("physical").scan(scene, (-7.8, 0, 0), 1)
    sight = find_sight(scene, scan)
    assert np.unique(sight.ends).tolist() == [BeamEnd.STOPPED]
    assert sight.words(BeamEnd.STOPPED) == "smoke"
