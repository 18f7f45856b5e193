import numpy as np
import pytest
import shapely

from radarsim.autonomy.plotting.outlines import outlines_of
from radarsim.geometry import Floats
from radarsim.robots.obstacles import enclosed_area
from radarsim.scene.map_file import load_map


def ring(*corners: tuple[float, float]) -> Floats:
    points = np.array(corners, float)
    return np.stack([points, np.roll(points, -1, axis=0)], axis=1)


def square(x: float, side: float) -> Floats:
    return ring((x, x), (x + side, x), (x + side, x + side), (x, x + side))


def test_ring_inside_another_is_a_hole() -> None:
    area = enclosed_area(np.concatenate([square(0, 3), square(1, 1)]))
    assert shapely.area(area) == pytest.approx(8)


def test_line_encloses_nothing() -> None:
    assert shapely.is_empty(enclosed_area(np.array([[[0.0, 0.0], [1.0, 0.0]]])))
    assert shapely.is_empty(enclosed_area(np.zeros((0, 2, 2))))


@pytest.mark.parametrize("height", [0.346, 0.4, 0.5, 1.0])
def test_trees_whose_branches_cross_have_outlines(height: float) -> None:
    outlines = outlines_of(load_map("marulan_trial"), height)
    assert any(outline.lines for outline in outlines)
