"""Figure of the three shapes: side views, ends of rays, histograms of ranges."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from radarsim.generators.plants.growth import LEAVES, WOOD
from radarsim.generators.plants.plant import Plant
from radarsim.geometry import Floats
from radarsim.lab.plants import (
    BEFORE,
    HEIGHT,
    WALL,
    Comparison,
    PlantRanges,
)
from radarsim.plotting.palette import FAMILY_COLOURS, MARKER, RADAR, Family
from radarsim.robots.obstacles import slice_mesh

COLOURS: Final = {
    WOOD: FAMILY_COLOURS[Family.WOOD],
    LEAVES: FAMILY_COLOURS[Family.FOLIAGE],
}
SUN: Final = np.array([-0.45, -0.55, 0.7])  # direction to the light: above left
AMBIENT: Final = 0.55  # brightness of faces along the light
RAY, END, WALL_END = RADAR, RADAR, MARKER
BIN: Final = 0.1  # m
SMALL: Final[dict[str, Any]] = {"loc": "left", "fontsize": "medium"}  # of panels
TITLE: Final = "A shrub in three shapes: the same mean transmission, another scatter"
WIDTH: Final = 9.6  # inches; its letters are read where the manual shows it
TITLE_HEIGHT: Final = 0.45  # inches
MARGIN: Final = 0.15  # m, of the plan


def plot_shapes(shapes: Sequence[Comparison]) -> Figure:
    """Plot a row for each shape, with side view, plan and histogram of ranges."""
    height = TITLE_HEIGHT + 2.7 * len(shapes)
    figure = Figure(figsize=(WIDTH, height), dpi=150)
    below = (0, 0, 1, 1 - TITLE_HEIGHT / height)
    figure.set_layout_engine("constrained", rect=below)
    top = 1 - TITLE_HEIGHT / 3 / height
    figure.text(0.012, top, TITLE, va="top", fontsize=13, fontweight="bold")
    grid = figure.subplots(len(shapes), 3, squeeze=False, width_ratios=[1.0, 1.5, 1.5])
    # One scale for all three, as they are to be compared.
    highest = max(_shares(shape.ranges)[0].max() for shape in shapes)
    for (side, plan, bars), shape in zip(grid, shapes, strict=True):
        draw_plant(side, shape.plant)
        side.set_title(shape.title, **SMALL)
        _draw_plan(plan, shape)
        _draw_histogram(bars, shape.ranges, 100 * highest)
    return figure


def draw_plant(axes: Axes, plant: Plant) -> None:
    """Draw a plant in sunlight as seen from the side, from -y."""
    polygons, colours, depths = [], [], []
    for name, (vertices, faces) in plant.pieces.items():
        corners = vertices[faces]
        light = brightness(corners)
        polygons.append(corners[:, :, [0, 2]])
        colours.append(light[:, None] * np.array(to_rgb(COLOURS[name])))
        depths.append(corners[:, :, 1].mean(axis=1))
    order = np.argsort(-np.concatenate(depths))  # painter's algorithm: far faces first
    sorted_colours = np.concatenate(colours)[order]
    triangles = painted_triangles(
        np.concatenate(polygons)[order], sorted_colours, linewidths=0.2
    )
    axes.add_collection(triangles)
    axes.axhline(0.0, color="0.6", linewidth=0.8, zorder=0)
    axes.autoscale()
    axes.set_aspect("equal")
    axes.set_xlabel("x, m")
    axes.set_ylabel("z, m")


def painted_triangles(corners: Floats, colours: Floats, **style: Any) -> PolyCollection:
    """Return triangles as matplotlib draws them, in the order given.

    Args:
        corners: (T, 3, 2), in units of the axes.
        colours: RGB, (T, 3) for each triangle or (3,) for all, from 0 to 1.
        **style: Other properties of the collection.
    """
    # an array is much faster than a sequence of arrays, but missing in the types
    polygons: Any = corners
    return PolyCollection(polygons, facecolors=colours, edgecolors=colours, **style)


def brightness(
    corners: Floats, sun: Floats = SUN, *, both_sides: bool = True
) -> Floats:
    """Return the brightness of triangles in the sun.

    Args:
        corners: (T, 3, 3) m.
        sun: (3,) direction to the light; its length does not matter.
        both_sides: Whether a triangle is as bright when lit from its back, like a leaf.

    Returns:
        (T,) from 0 to 1.
    """
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    facing = normals @ (sun / np.linalg.norm(sun))
    lit = np.abs(facing) if both_sides else np.maximum(facing, 0.0)
    return np.asarray(AMBIENT + (1 - AMBIENT) * lit)


def _draw_plan(axes: Axes, shape: Comparison) -> None:
    """Draw the cross-section at the scanner's height, and the rays from one side."""
    for name, (vertices, faces) in shape.plant.pieces.items():
        lines = list(slice_mesh(vertices, faces, HEIGHT))
        axes.add_collection(
            LineCollection(lines, colors=COLOURS[name], linewidths=1.1, zorder=2)
        )
    offsets, ranges = shape.ranges.offsets, shape.ranges.ranges[0]
    ends = ranges - BEFORE
    rays = [((-BEFORE, y), (x, y)) for x, y in zip(ends, offsets, strict=True)]
    axes.add_collection(
        LineCollection(rays, colors=RAY, linewidths=0.4, alpha=0.6, zorder=1)
    )
    wall = ranges >= WALL
    axes.plot(ends[~wall], offsets[~wall], ".", color=END, markersize=4, zorder=3)
    axes.plot(ends[wall], offsets[wall], ".", color=WALL_END, markersize=4, zorder=3)
    side = float(np.abs(offsets).max()) + MARGIN
    axes.plot([WALL - BEFORE] * 2, [-side, side], color=MARKER, linewidth=2)
    axes.set_xlim(-2, WALL - BEFORE + MARGIN)
    axes.set_ylim(-side, side)
    axes.set_aspect("equal")
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    axes.set_title(f"rays at a height of {HEIGHT:.2f} m", **SMALL)


def _shares(ranges: PlantRanges) -> tuple[Floats, Floats]:
    """Return the share of ranges in each bin, the wall's last, and the bins' edges."""
    edges = np.arange(BEFORE - 1 - BIN / 2, WALL + BIN, BIN)
    counts, edges = np.histogram(ranges.ranges, bins=edges)
    return counts / counts.sum(), edges


def _draw_histogram(axes: Axes, ranges: PlantRanges, highest: float) -> None:
    """Draw the shares of ranges up to ``highest`` %; the last bar is the wall's."""
    shares, edges = _shares(ranges)
    axes.bar(edges[:-2] + BIN / 2, 100 * shares[:-1], BIN, color=END)
    axes.bar(edges[-2] + BIN / 2, 100 * shares[-1], BIN, color=WALL_END)
    axes.annotate(
        f"wall\n{100 * shares[-1]:.0f} %",
        (WALL, 100 * shares[-1]),
        xytext=(0, 3),
        textcoords="offset points",
        ha="center",
        va="bottom",
    )
    statistics = ranges.statistics()
    text = (
        f"all: {statistics.mean:.2f} ± {statistics.deviation:.2f} m\n"
        f"where spent: ± {statistics.spent:.2f} m"
    )
    axes.text(0.82, 0.95, text, transform=axes.transAxes, ha="right", va="top")
    axes.set_xlim(BEFORE - 1, WALL + 0.35)
    axes.set_ylim(0, 1.3 * highest)  # with space for the text
    axes.set_xlabel("range, m")
    axes.set_ylabel(f"% of rays in {BIN} m")
    axes.set_title("ranges from all sides", **SMALL)
