"""Outlines of true objects, by what they are to a robot and its radar."""

import numpy as np
import pytest
import shapely
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from parts import STONE, slab

from radarsim.autonomy.evaluation.map_score import class_of
from radarsim.autonomy.mapping.occupancy_grid import CellClass
from radarsim.autonomy.plotting import outlines
from radarsim.plotting.palette import FAMILY_COLOURS, Family
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.scene.shapes import sphere

KINDS = (CellClass.SMOKE, CellClass.FOLIAGE, CellClass.OBSTACLE)
LEAF = Material("leaf", 0.7)
SMOKE = Material("smoke", 0.0, 0.5, solid=False)


def test_overlapping_things_have_one_outline_together() -> None:
    """So that the corners of a room, where two walls meet, are drawn once."""
    scene = Scene("x", "X", (slab(0, 0, (4, 1)), slab(2, 1, (1, 3))))
    (outline,) = outlines.outlines_of(scene, 0.5)
    (line,) = outline.lines
    area = shapely.Polygon(line)
    both = shapely.union(
        shapely.box(-2, -0.5, 2, 0.5), shapely.box(1.5, -0.5, 2.5, 2.5)
    )
    assert area.symmetric_difference(both).area == pytest.approx(0, abs=1e-9)


def test_only_what_reaches_the_height_is_outlined() -> None:
    scene = Scene("x", "X", (slab(0, 0, (1, 1), high=0.2), slab(3, 0, (1, 1))))
    (outline,) = outlines.outlines_of(scene, 0.5)
    assert len(outline.lines) == 1
    assert outlines.outlines_of(scene, 2.0) == ()


def test_each_kind_has_its_outline() -> None:
    parts = (
        slab(5, 0, (1, 1)),
        Part("bush", LEAF, *sphere(1.0)),
        Part("cloud", SMOKE, *sphere(1.0)),
    )
    found = outlines.outlines_of(Scene("x", "X", parts), 0.5)
    assert [outline.kind for outline in found] == [*KINDS]
    assert class_of(Material("leaves", sheet_loss=0.2)) == CellClass.FOLIAGE
    extent = outlines.outlines_extent(found)
    assert extent is not None
    assert (extent.x1, extent.y1) == pytest.approx((5.5, 0.87), abs=0.02)
    assert outlines.outlines_extent(()) is None


def test_open_surface_is_outlined_by_its_lines() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1.0], [1, 0, 1.0]])
    sheet = Part("sheet", STONE, vertices, np.array([[0, 1, 2], [1, 3, 2]]))
    (outline,) = outlines.outlines_of(Scene("x", "X", (sheet,)), 0.5)
    assert sum(float(np.hypot(*(b - a))) for a, b in outline.lines) == pytest.approx(1)


def test_each_family_of_materials_has_its_colour_and_its_row() -> None:
    parts = (
        slab(0, 0, (1, 1)),
        Part("crate", Material("wood"), *sphere(1.0)),
        Part("car", Material("steel"), *sphere(1.0)),
    )
    found = outlines.outlines_of(Scene("x", "X", parts), 0.5)
    assert {outline.kind for outline in found} == {CellClass.OBSTACLE}
    axes = Figure().add_subplot()
    drawn = outlines.draw_areas(axes, found)
    rows = {str(row.get_label()): row for row in outlines.area_rows(found)}
    for family in (Family.STONE, Family.WOOD, Family.METAL):
        colour = to_rgba(FAMILY_COLOURS[family])
        row = rows.pop(family.value)
        assert isinstance(row, Patch)
        assert row.get_facecolor() == colour
        assert colour in {patch.get_facecolor() for patch in drawn}
    assert not rows
