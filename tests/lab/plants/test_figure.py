"""The figure that compares the three shapes of a shrub."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from radarsim.generators.plants.plant import SEED
from radarsim.lab.figures.plants import plot_shapes
from radarsim.lab.plants import WALL, Comparison, compare_shapes


@pytest.fixture(scope="module")
def shapes() -> list[Comparison]:
    return list(compare_shapes(SEED, rays=20, azimuths=4))


@pytest.fixture(scope="module")
def figure(shapes: list[Comparison]) -> Figure:
    figure = plot_shapes(shapes)
    figure.draw_without_rendering()
    return figure


def test_bar_of_the_wall_is_whole_within_the_axes(
    shapes: list[Comparison], figure: Figure
) -> None:
    assert len(shapes) == 3
    for axes, shape in zip(figure.axes[2::3], shapes, strict=True):
        (*_, wall) = (each for each in axes.patches if isinstance(each, Rectangle))
        left, right = axes.get_xlim()
        assert left < wall.get_x() < WALL < wall.get_x() + wall.get_width() < right
        through = shape.ranges.statistics().through
        assert wall.get_height() == pytest.approx(100 * through)
        assert wall.get_height() < axes.get_ylim()[1]


def test_histograms_share_limits_and_their_texts_cover_no_bar(figure: Figure) -> None:
    panels = figure.axes[2::3]
    assert len({axes.viewLim.bounds for axes in panels}) == 1
    for axes in panels:
        bars = [bar.get_window_extent() for bar in axes.patches]
        boxes = [text.get_window_extent() for text in axes.texts]
        for box in boxes:
            assert axes.bbox.x0 < box.x0 < box.x1 < axes.bbox.x1
            assert not any(box.overlaps(bar) for bar in bars if bar.height > 1)
        assert not boxes[0].overlaps(boxes[1])


def test_labels_of_neighbouring_panels_do_not_collide(figure: Figure) -> None:
    found = [axes.get_tightbbox() for axes in figure.axes]
    boxes = [np.asarray(box.extents) for box in found if box is not None]
    assert len(boxes) == len(figure.axes)
    for number, one in enumerate(boxes):
        for other in boxes[number + 1 :]:
            apart = (one[2:] <= other[:2] + 1) | (other[2:] <= one[:2] + 1)
            assert apart.any()
