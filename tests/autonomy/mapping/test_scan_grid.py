import numpy as np
import pytest
from flat_world import NOWHERE, box, look

from radarsim.autonomy.mapping.mapper import RebuildableGrid
from radarsim.autonomy.mapping.trajectory import Trajectory
from radarsim.geometry import Floats, Pose2


def seen_from(walls: Floats, places: list[float]) -> float:
    trajectory = Trajectory()
    grid = RebuildableGrid(trajectory, 0.05, 0.2)
    for time, x in enumerate(places):
        pose = Pose2(x, 0.0, 0.5 * time)
        trajectory.add(float(time), pose)
        grid.add(look(walls, pose))
    return grid.seen_from_one_place()


@pytest.mark.parametrize(
    ("places", "share"),
    [([-0.6, -0.4, -0.2], 1.0), ([0.2, 1.3], 0.0), ([0.2, 0.7, 0.2], 1.0)],
)
def test_walls_are_seen_from_one_place_until_the_robot_has_driven_a_metre(
    places: list[float], share: float
) -> None:
    assert seen_from(box(0.1, 0.1, 6, 4), places) == pytest.approx(share)


@pytest.mark.parametrize("places", [[0.0, 1.3], [0.0, 1.3, 0.2]])
def test_what_a_screen_hides_from_the_second_place_is_seen_from_one(
    places: list[float],
) -> None:
    screen = np.array([[[2.0, -1], [2, 1]]])
    walls = np.concatenate([box(1.1, 0.1, 6, 10), screen])
    # Of the wall behind it, at a distance of 2 m, more than this from the middle.
    first, second = 4.1 / 2, 2.8 / 0.7
    seen = 10 + 6 + 6 + 2 + 10 - 2 * first
    expected = 2 * (second - first) / seen
    assert seen_from(walls, places) == pytest.approx(expected, abs=0.03)


def test_empty_map_leaves_no_wall_in_doubt() -> None:
    assert seen_from(NOWHERE, [0.0]) == 0.0
