"""Filled plans of maps, for figures without axes."""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from radarsim.figures.scene_view import NATURAL
from radarsim.geometry import Floats
from radarsim.robots.obstacles import slice_mesh
from radarsim.scene.scene import Part, Scene

HALO: Final = withStroke(linewidth=2.5, foreground="white")
TITLE_GAP: Final = 0.16  # inches above the title
FOLIAGE_OPACITY: Final = 0.55  # of what beams enter


def draw_plan(
    axes: Axes, scene: Scene, height: float, skip: Sequence[str] = ()
) -> None:
    """Draw the section of a map at a height, filled by material.

    Args:
        axes: Axes in m, map frame.
        scene: The map.
        height: Height of the section, m.
        skip: Names of objects to leave out.
    """
    for part in scene.parts:
        if part.object_name not in skip:
            draw_part(axes, part, height)
    axes.set_aspect("equal")


def draw_part(
    axes: Axes, part: Part, height: float, place: Callable[[Floats], Floats] = np.array
) -> None:
    """Draw the section of a part at a height, filled in the colour of its material.

    Args:
        axes: Axes in m.
        part: The part.
        height: Height of the section, m, map frame.
        place: Returns where in the axes points, (..., 2) m, of the map are.
    """
    lines = place(slice_mesh(part.vertices, part.faces, height))
    material = part.material
    colour = NATURAL[material.name]
    if material.sheet_loss is not None:  # leaves are surfaces without an inside
        _draw_leaves(axes, lines, colour)
        return
    filled = PolyCollection(
        sections(lines),
        facecolors=colour,
        edgecolors=colour,
        alpha=FOLIAGE_OPACITY if material.penetrable else 1.0,
        linewidths=0.5,
        zorder=1,
        label=part.object_name,
    )
    axes.add_collection(filled)


def _draw_leaves(axes: Axes, lines: Floats, colour: str) -> None:
    """Draw surfaces without an inside: each of them, and their hull."""
    if not len(lines):
        return
    hull = shapely.convex_hull(shapely.multipoints(lines.reshape(-1, 2)))
    corners = shapely.get_coordinates(hull)
    inside = PolyCollection([corners], facecolors=colour, alpha=0.35, zorder=1)
    axes.add_collection(inside)
    axes.add_collection(LineCollection(list(lines), colors=colour, linewidths=1.0))


def sections(lines: Floats) -> list[Floats]:
    """Join line segments, (S, 2, 2) m, to closed rings of x and y, (C, 2) m each."""
    apart = np.abs(lines[:, 0] - lines[:, 1]).max(axis=1, initial=0.0) > 0
    strings = shapely.linestrings(np.round(lines[apart], 6))
    noded = shapely.node(shapely.multilinestrings(strings))
    union = shapely.union_all(shapely.polygonize([noded]).geoms)
    return [np.asarray(each.exterior.coords) for each in _polygons(union)]


def _polygons(shape: shapely.Geometry) -> Iterable[shapely.Polygon]:
    found: Iterable[shapely.Polygon] = shapely.get_parts(shape)
    return [each for each in found if not each.is_empty]


def as_words(name: str) -> str:
    """Return the name of an object as words: ``crate_low`` as ``crate low``."""
    return name.replace("_", " ")


def draw_title(drawing: Figure, text: str) -> None:
    """Write the title of a figure at its upper left."""
    _, height = drawing.get_size_inches()
    drawing.text(
        *(0.02, 1 - TITLE_GAP / height), text, va="top", fontsize=17, fontweight="bold"
    )


def draw_scale_bar(axes: Axes) -> None:
    """Draw a bar of 1, 2 or 5 m or a tenth of these, an eighth of the width or less."""
    low, high = axes.get_xlim()
    size = (high - low) / 8
    unit = 10 ** math.floor(math.log10(size))
    length = max(step * unit for step in (1, 2, 5) if step * unit <= size)
    bottom, top = axes.get_ylim()
    x, y = low + 0.05 * (high - low), bottom + 0.08 * (top - bottom)
    style: dict[str, Any] = {
        "color": "black",
        "linewidth": 2.5,
        "solid_capstyle": "butt",
    }
    axes.plot([x, x + length], [y, y], zorder=9, label="scale", **style)
    axes.annotate(
        f"{length:g} m",
        (x + length / 2, y),
        xytext=(0, 3),
        textcoords="offset points",
        ha="center",
        path_effects=[HALO],
        zorder=9,
    )
