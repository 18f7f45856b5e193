"""Figure of the three shapes: side views, ends of rays, histograms of ranges."""

import io
from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from radarsim.geometry import Floats
from radarsim.plants.calibration import Comparison
from radarsim.plants.parameters import LEAVES, WOOD
from radarsim.plants.plant import Plant
from radarsim.plants.range_profile import BEFORE, HEIGHT, WALL, PlantRanges
from radarsim.robots.obstacles import slice_mesh

COLOURS: Final = {WOOD: "#7a4a21", LEAVES: "#3f8f3a"}
SUN: Final = np.array([-0.45, -0.55, 0.7])  # direction to the light: above left
AMBIENT: Final = 0.55  # brightness of faces along the light
RAY, END, WALL_END = "tab:blue", "tab:red", "black"
BIN: Final = 0.05  # m
MARGIN: Final = 0.15  # m, of the plan


def draw_shapes(shapes: Sequence[Comparison]) -> bytes:
    """Draw a row for each shape, with side view, plan and histogram; return a PNG."""
    figure = Figure(figsize=(13.5, 3.7 * len(shapes)), dpi=110, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    grid = figure.subplots(len(shapes), 3, squeeze=False, width_ratios=[1, 1.55, 1.25])
    highest = max(_shares(shape.ranges)[0][:-1].max() for shape in shapes)
    for (side, plan, bars), shape in zip(grid, shapes, strict=True):
        draw_plant(side, shape.plant)
        side.set_title(shape.title, fontsize="medium")
        _draw_plan(plan, shape)
        _draw_histogram(bars, shape.ranges, highest)
    png = io.BytesIO()
    canvas.print_figure(png, format="png", metadata={"Software": "radarsim"})
    return png.getvalue()


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
    triangles = PolyCollection(
        list(np.concatenate(polygons)[order]),
        facecolors=sorted_colours,
        edgecolors=sorted_colours,
        linewidths=0.2,
    )
    axes.add_collection(triangles)
    axes.axhline(0.0, color="0.6", linewidth=0.8, zorder=0)
    axes.autoscale()
    axes.set_aspect("equal")
    axes.set_xlabel("x, m")
    axes.set_ylabel("z, m")


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
    axes.plot([WALL - BEFORE] * 2, [-side, side], color="black", linewidth=2)
    axes.set_xlim(-2, WALL - BEFORE + MARGIN)
    axes.set_ylim(-side, side)
    axes.set_aspect("equal")
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    axes.set_title(
        f"rays from the left, {HEIGHT} m above the ground", fontsize="medium"
    )


def _shares(ranges: PlantRanges) -> tuple[Floats, Floats]:
    """Return the share of ranges in each bin, the wall's last, and the bins' edges."""
    edges = np.arange(BEFORE - 1, WALL + 1.5 * BIN, BIN)
    counts, edges = np.histogram(ranges.ranges, bins=edges)
    return counts / counts.sum(), edges


def _draw_histogram(axes: Axes, ranges: PlantRanges, highest: float) -> None:
    shares, edges = _shares(ranges)
    axes.stairs(100 * shares[:-1], edges[:-1], fill=True, color=END, alpha=0.8)
    statistics = ranges.statistics()
    low, median, high = statistics.percentiles
    text = (
        f"mean {statistics.mean:.2f} m, deviation {statistics.deviation:.2f} m\n"
        f"5, 50, 95 %: {low:.2f}, {median:.2f}, {high:.2f} m\n"
        f"deviation at one offset {statistics.at_one_offset:.2f} m,"
        f" where spent {statistics.spent:.2f} m\n"
        f"{100 * statistics.through:.0f} % read the wall, at {WALL:g} m"
    )
    axes.text(0.97, 0.95, text, transform=axes.transAxes, ha="right", va="top")
    axes.set_xlim(BEFORE - 1, WALL)
    axes.set_ylim(0, 145 * highest)  # with space for the text
    axes.set_xlabel("range, m")
    axes.set_ylabel(f"% of rays in {BIN:g} m")
    axes.set_title("ranges from all sides", fontsize="medium")
