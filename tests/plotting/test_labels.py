"""Labels of plans: none lies on another, or beyond the frame."""

import itertools
from collections.abc import Sequence

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation

import radarsim
from radarsim import Material, Part, Scene
from radarsim.plotting.labels import LONGEST, Label, write_labels
from radarsim.rng import generator_for
from radarsim.scene.shapes import box


def crowded(seed: int, count: int, letters: int) -> Scene:
    """Make a map of small things of many names that lie close to each other."""
    rng = generator_for(seed, "crowd")
    parts = []
    for number in range(count):
        long, wide = rng.uniform(0.2, 1.5, 2).tolist()
        vertices, faces = box(long, wide, 1.0)
        place = np.array([*rng.uniform(-6, 6, 2), 0.5])
        name = "".join(rng.choice(list("abcdefghij_")) for _ in range(letters))
        name = f"{name}_of_{chr(97 + number % 26)}{chr(97 + number // 26)}"
        parts.append(Part(name, Material("wood"), vertices + place, faces))
    return Scene("crowd", "Crowd", tuple(parts))


def written(axes: Axes) -> list[Annotation]:
    return [text for text in axes.texts if isinstance(text, Annotation)]


def assert_apart(axes: Axes) -> None:
    """Check that labels are within the frame, and overlap in no pixel."""
    figure_of(axes).draw_without_rendering()
    frame = axes.get_window_extent()
    boxes = {text.get_text(): text.get_window_extent() for text in written(axes)}
    for name, each in boxes.items():
        assert frame.contains(*each.min), name
        assert frame.contains(*each.max), name
    for one, other in itertools.combinations(boxes, 2):
        a, b = boxes[one], boxes[other]
        apart = a.x1 <= b.x0 or b.x1 <= a.x0 or a.y1 <= b.y0 or b.y1 <= a.y0
        assert apart, (one, other)


def figure_of(axes: Axes) -> Figure:
    figure = axes.get_figure(root=True)
    assert isinstance(figure, Figure)
    return figure


def rows(figure: Figure) -> Sequence[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.parametrize(
    ("seed", "count", "letters"), [(0, 12, 4), (1, 60, 10), (3, 100, 40)]
)
def test_labels_of_a_crowded_map_do_not_overlap(
    seed: int, count: int, letters: int
) -> None:
    axes = crowded(seed, count, letters).plot()
    assert len(written(axes)) >= 12
    assert_apart(axes)


@pytest.mark.parametrize("name", ["foliage_room", "bug_u_trap", "orchard"])
def test_labels_of_shipped_maps_do_not_overlap(name: str) -> None:
    axes = radarsim.load_map(name).plot()
    assert_apart(axes)


def test_long_names_are_numbers_with_their_texts_in_the_legend() -> None:
    vertices, faces = box(1.0, 1.0, 1.0)
    long = "a_name_that_is_much_longer_than_what_it_names"
    scene = Scene("one", "One", (Part(long, Material("wood"), vertices, faces),))
    axes = scene.plot()
    assert [text.get_text() for text in written(axes)] == ["1"]
    assert long.replace("_", " ") in " ".join(rows(figure_of(axes))).replace("\n", " ")


def test_a_legend_does_not_list_names_without_end() -> None:
    figure = figure_of(crowded(0, 150, 40).plot())
    assert rows(figure)[-1].startswith("and ")
    figure.draw_without_rendering()
    legend = figure.legends[0].get_window_extent()
    assert figure.bbox.contains(*legend.min)
    assert figure.bbox.contains(*legend.max)


def test_without_numbers_long_labels_are_cut_off_and_crowded_ones_left_out() -> None:
    axes = Figure().add_subplot()
    axes.set(xlim=(0, 1), ylim=(0, 1))
    labels = [Label("x" * 60, (0.5, 0.5, 0.5, 0.5)) for _ in range(40)]
    assert write_labels(axes, labels) == {}
    assert 1 < len(written(axes)) < 40
    assert {len(text.get_text()) for text in written(axes)} == {LONGEST}
    assert_apart(axes)


def test_label_lies_in_what_it_names_if_it_fits() -> None:
    axes = Figure().add_subplot()
    axes.set(xlim=(0, 1), ylim=(0, 1))
    write_labels(axes, [Label("in", (0.3, 0.3, 0.7, 0.7), is_inside=True)])
    (text,) = written(axes)
    middle = axes.transData.transform((0.5, 0.5))
    box_of_text = text.get_window_extent()
    assert box_of_text.contains(*middle)


def test_plan_has_coordinates_in_metres(foliage_room: Scene) -> None:
    axes = foliage_room.plot()
    assert axes.get_xlabel().startswith("x, m")
    assert axes.get_ylabel() == "y, m"
    figure_of(axes).draw_without_rendering()
    ticks = {text.get_text() for text in axes.get_xticklabels()}
    assert "5" in ticks
    assert len([line for line in axes.get_xgridlines() if line.get_visible()]) > 2
