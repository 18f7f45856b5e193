"""Scores of maps whose errors are known."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from radarsim.autonomy.evaluation.map_score import Score, Truth, score_map
from radarsim.autonomy.evaluation.mapping_run import MappingRun
from radarsim.autonomy.mapping.occupancy_grid import (
    CellClass,
    GridFrame,
    Mask,
    OccupancyGrid,
)
from radarsim.autonomy.plans import ExplorationPlan
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.server.host import Host

HEIGHT = 0.346
START = (-8.0, 0.0)
FRAME = GridFrame(0.05).extended_to((-12.0, -8.0), (12.0, 8.0))


class Painted(OccupancyGrid):
    """A map with given classes."""

    def __init__(self, classes: NDArray[np.uint8]) -> None:
        super().__init__(FRAME.resolution)
        self.frame = FRAME
        self._painted = classes

    def classes(self) -> NDArray[np.uint8]:
        return self._painted

    def short_range_cells(self) -> Mask:
        return around(*START, 3.0)


def perfect(scene: Scene) -> NDArray[np.uint8]:
    """Return the classes of a map that is right everywhere indoors."""
    truth = Truth(scene, FRAME, HEIGHT)
    classes = np.where(truth.indoors, CellClass.FREE, CellClass.UNKNOWN).astype(
        np.uint8
    )
    for kind in (CellClass.SMOKE, CellClass.FOLIAGE):
        classes[truth.kinds[kind]] = kind
    classes[truth.kinds[CellClass.OBSTACLE]] = (
        CellClass.UNKNOWN
    )  # beams do not enter it
    classes[truth.kinds[CellClass.OBSTACLE] & truth.faces(outdoors=False)] = (
        CellClass.OBSTACLE
    )
    return classes


def compute_score(classes: NDArray[np.uint8], scene: Scene, **overrides: Any) -> Score:
    values = {"start": START, "robot_radius": 0.371, "height": HEIGHT, **overrides}
    return score_map(Painted(classes), scene, **values)


def around(x: float, y: float, radius: float) -> Mask:
    across, up = FRAME.cell_centers()
    return np.asarray(np.hypot(across - x, up[:, None] - y) <= radius)


@pytest.mark.parametrize("name", ["empty_room", "foliage_room", "smoke_room"])
def test_true_map_has_a_perfect_score(name: str) -> None:
    scene = load_map(name)
    score = compute_score(perfect(scene), scene)
    assert score["wrong"] == score["unknown"] == 0
    assert score["coverage"] == score["within_one_cell"] == score["told_apart"] == 1.0
    assert score["false_obstacles"] == 0.0
    assert score["right"] > 100_000


def test_unknown_cells_are_not_wrong(foliage_room: Scene) -> None:
    score = compute_score(
        np.full(FRAME.shape, CellClass.UNKNOWN, np.uint8), foliage_room
    )
    assert (score["right"], score["wrong"], score["obstacles"]) == (0, 0, 0)
    assert score["coverage"] == score["hidden_coverage"] == 0.0
    assert score["reachable_coverage"] == 0.0
    assert score["near_coverage"] == pytest.approx(0.1, abs=0.02)  # around the start
    assert (
        score["within_one_cell"]
        is score["within_two_cells"]
        is score["told_apart"]
        is None
    )
    assert score["unknown"] is not None
    assert score["unknown"] * 0.05**2 == pytest.approx(20.8 * 12.8, rel=0.02)


def test_hidden_floor_is_what_the_robot_cannot_reach(foliage_room: Scene) -> None:
    classes = perfect(foliage_room)
    across, _ = FRAME.cell_centers()
    classes[:, across > 0.5] = CellClass.UNKNOWN
    assert compute_score(classes, foliage_room)["hidden_coverage"] == 0.0
    classes = perfect(foliage_room)
    classes[:, across < 0.0] = CellClass.UNKNOWN
    assert compute_score(classes, foliage_room)["hidden_coverage"] == 1.0
    # from behind it is the other side that is hidden
    assert (
        compute_score(classes, foliage_room, start=(6.0, 3.0))["hidden_coverage"] == 0.0
    )


def test_nothing_is_hidden_where_everything_is_reachable(empty_room: Scene) -> None:
    assert compute_score(perfect(empty_room), empty_room)["hidden_coverage"] is None


@pytest.mark.parametrize("cells", [0, 1, 2, 3])
def test_walls_within_two_cells_are_right(empty_room: Scene, cells: int) -> None:
    classes = np.roll(perfect(empty_room), cells, axis=0)
    score = compute_score(classes, empty_room)
    assert (score["wrong"] == 0) == (cells <= 2)
    assert score["within_two_cells"] is not None
    assert score["within_one_cell"] is not None
    assert (score["within_one_cell"] == 1.0) == (cells <= 1)
    assert (score["within_two_cells"] == 1.0) == (cells <= 2)
    assert (score["false_obstacles"] == 0.0) == (cells <= 2)


@pytest.mark.parametrize(
    ("place", "kind", "is_right"),
    [
        pytest.param((-5.0, 0.0), CellClass.OBSTACLE, False, id="a wall in the air"),
        pytest.param((-5.0, 0.0), CellClass.FOLIAGE, False, id="foliage in the air"),
        pytest.param((-5.0, 0.0), CellClass.SMOKE, False, id="smoke in the air"),
        pytest.param((0.5, -1.64), CellClass.FREE, False, id="nothing in foliage"),
        pytest.param((0.5, -1.64), CellClass.OBSTACLE, True, id="a wall in foliage"),
        pytest.param((4.0, 3.2), CellClass.FREE, False, id="nothing in a crate"),
        pytest.param((4.0, 3.2), CellClass.FOLIAGE, True, id="foliage in a crate"),
        pytest.param((-5.0, 9.0), CellClass.FREE, True, id="nothing outside"),
    ],
)
def test_wrong_cells_are_counted(
    foliage_room: Scene, place: tuple[float, float], kind: int, is_right: bool
) -> None:
    classes = perfect(foliage_room)
    spot = around(*place, 0.2)
    if place[1] < 7:
        classes[spot] = kind
    score = compute_score(classes, foliage_room)
    wrong = 0 if is_right else np.count_nonzero(spot)
    assert score["wrong"] == wrong
    in_the_air = kind == CellClass.OBSTACLE and not is_right
    assert (score["false_obstacles"] > 0) == in_the_air


def test_class_accuracy_counts_foliage_taken_for_walls(foliage_room: Scene) -> None:
    classes = perfect(foliage_room)
    classes[classes == CellClass.FOLIAGE] = CellClass.OBSTACLE
    score = compute_score(classes, foliage_room)
    assert score["wrong"] == 0
    assert score["told_apart"] is not None
    assert 0.0 < score["told_apart"] < 0.9


def test_smoke_has_to_be_classified_as_smoke(smoke_room: Scene) -> None:
    classes = perfect(smoke_room)
    classes[classes == CellClass.SMOKE] = CellClass.FREE
    score = compute_score(classes, smoke_room)
    assert score["wrong"] * 0.05**2 == pytest.approx(12.5 * 13, rel=0.06)


def test_open_terrain_has_no_coverage() -> None:
    scene = load_map("bug_box")
    score = compute_score(
        np.full(FRAME.shape, CellClass.FREE, np.uint8), scene, start=(-4.0, -0.4)
    )
    assert score["unknown"] is score["coverage"] is score["near_coverage"] is None
    assert score["wrong"] > 0  # the box is not free


def test_leaves_have_no_interior() -> None:
    scene = load_map("forest_edge")
    frame = GridFrame(0.05).extended_to((-21.0, -16.0), (21.0, 16.0))
    truth = Truth(scene, frame, HEIGHT)
    leaves = truth.kinds[CellClass.FOLIAGE] & ~truth.inside[CellClass.FOLIAGE]
    assert np.count_nonzero(leaves) > 1000
    assert truth.indoors[frame.cell(-15.0, 0.0) or (0, 0)]


def test_json_values_are_rounded(empty_room: Scene) -> None:
    run = MappingRun(ExplorationPlan(), Host(empty_room))
    run.score = compute_score(perfect(empty_room), empty_room)
    values = run.to_dict()["judge"]
    assert values["coverage"] == 1.0
    assert values["hidden_coverage"] is None
    assert all(len(str(value)) < 8 for value in values.values())


# A room of 8 by 6 m: a closed block of four walls in one corner, 1.9 by 1.9 m inside,
# and a hedge that parts the last 2 m, which a radar sees through.
BLOCK_ROOM = """\
version: 1
materials: {wall: {density: opaque}, hedge: {density: 0.5}}
objects:
  - {name: floor, box: [20, 20, 0.2], position: [0, 0, -0.1], material: wall}
  - {name: north, box: [8.2, 0.2, 2], position: [0, 3.1, 1], material: wall}
  - {name: south, box: [8.2, 0.2, 2], position: [0, -3.1, 1], material: wall}
  - {name: east, box: [0.2, 6, 2], position: [4.1, 0, 1], material: wall}
  - {name: west, box: [0.2, 6, 2], position: [-4.1, 0, 1], material: wall}
  - {name: block_side, box: [0.1, 2, 2], position: [-1.95, 2, 1], material: wall}
  - {name: block_front, box: [2, 0.1, 2], position: [-3, 1.05, 1], material: wall}
  - {name: hedge, box: [0.4, 6, 2], position: [2.2, 0, 1], material: hedge}
starts: [{name: RobotStart1, position: [-1, -1.5, 0]}]
"""


@pytest.fixture(scope="module")
def block_room(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    path = tmp_path_factory.mktemp("maps") / "block_room.yaml"
    path.write_text(BLOCK_ROOM)
    return load_map(path)


def score_of_seen(scene: Scene, seen: Mask) -> Score:
    classes = np.where(seen, CellClass.FREE, CellClass.UNKNOWN).astype(np.uint8)
    return compute_score(classes, scene, start=(-1.0, -1.5))


def test_reachable_floor_is_that_of_the_robot_without_closed_blocks(
    block_room: Scene,
) -> None:
    across, up = (axis.ravel() for axis in np.meshgrid(*FRAME.cell_centers()))
    across, up = across.reshape(FRAME.shape), up.reshape(FRAME.shape)
    in_block = (across < -1.9) & (up > 1.0)
    this_side = (across < 2.0) & ~in_block
    score = score_of_seen(block_room, this_side)
    assert score["reachable_coverage"] == 1.0
    assert score["hidden_coverage"] == 0.0
    assert score["coverage"] == pytest.approx((36 - 4) / (36 - 4 + 1.6 * 6), abs=0.02)
    half = score_of_seen(block_room, this_side & (up < -1.0))
    assert half["reachable_coverage"] == pytest.approx(12 / (36 - 4), abs=0.02)
    behind = score_of_seen(block_room, across > 2.4)
    assert (behind["reachable_coverage"], behind["hidden_coverage"]) == (0.0, 1.0)
    assert score_of_seen(block_room, ~in_block)["coverage"] == 1.0


def test_walls_farther_than_15_cm_from_the_true_ones_are_misplaced(
    empty_room: Scene,
) -> None:
    right = perfect(empty_room)
    assert compute_score(right, empty_room)["misplaced"] == 0.0
    across, up = FRAME.cell_centers()
    for offset, is_misplaced in [(0.1, False), (0.3, True)]:
        classes = right.copy()
        row = np.abs(up - (6.4 - offset)).argmin()
        classes[row, np.abs(across) < 4.0] = CellClass.OBSTACLE  # a wall again
        misplaced = compute_score(classes, empty_room)["misplaced"]
        share = 160 / np.count_nonzero(classes == CellClass.OBSTACLE)
        assert misplaced == pytest.approx(share if is_misplaced else 0.0, rel=0.01)
