"""Plants: their mesh files, the calibration of their foliage, and its figure.

python examples/thesis/calibrate_plants.py [OUT [RAYS]]

OUT gets the mesh files of the shipped maps and ``shrub_shapes.png``. The loss of
foliage is calibrated with so many RAYS from each side until each shape of a shrub lets
the same mean share of power through: the transmission of a ray is the share of its
penetration power that is left behind the plant, and 0 if it ends there.
"""

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from common import brightness, painted_triangles
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray
from plants import (
    LEAVES,
    SEED,
    SHRUB,
    WOOD,
    Plant,
    Species,
    make_shrubs,
    plant_files,
)

from radarsim.geometry import Floats
from radarsim.plotting.palette import FAMILY_COLOURS, MARKER, RADAR, Family
from radarsim.raycast.rays import Outcome, Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.robots.obstacles import slice_mesh
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene

POWER: Final = 1.0  # initial power of rays
HEIGHT: Final = 0.346  # m above the ground, of a P3AT's scanner
BEFORE: Final = 4.0  # m from the rays' starts to the centre of the plant
BEHIND: Final = 3.0  # m from there to the wall, which is normal to the rays
WALL: Final = BEFORE + BEHIND

DENSITY: Final = 0.7  # power per metre, of the ball that defines the target
ACCURACY: Final = 1e-3  # relative, of calibrated values
DIGITS: Final = 3  # significant digits of calibrated values, as in a map file
RAYS: Final = 1600  # in each direction
MAX_DENSITY: Final = 10.0  # power per metre
WOODEN: Final = Material("wood")


COLOURS: Final = {
    WOOD: FAMILY_COLOURS[Family.WOOD],
    LEAVES: FAMILY_COLOURS[Family.FOLIAGE],
}
SUN: Final = np.array([-0.45, -0.55, 0.7])  # direction to the light: above left
BIN: Final = 0.1  # m
SMALL: Final[dict[str, Any]] = {"loc": "left", "fontsize": "medium"}  # of panels
TITLE: Final = "A shrub in three shapes: the same mean transmission, another scatter"
WIDTH: Final = 9.6  # inches; its letters are read where the manual shows it
TITLE_HEIGHT: Final = 0.45  # inches
MARGIN: Final = 0.15  # m, of the plan


@dataclass(frozen=True, eq=False)
class PlantRanges:
    """Ranges of horizontal rays through a plant at the height of a scanner."""

    offsets: Floats  # (K,) m, of the rays to the left of the plant's centre
    ranges: Floats  # (A, K) m, from A directions
    spent: NDArray[np.bool_]  # (A, K) whether the ray lost all its power in foliage


def measure_plant(
    species: Species,
    parts: Sequence[Part],
    *,
    offsets: int = 101,
    azimuths: int = 120,
) -> PlantRanges:
    """Measure ranges of parallel rays from all sides over the width of a crown."""
    height = (HEIGHT - species.crown_centre) / species.crown_half_height
    width = species.crown_radius * math.sqrt(max(1 - height**2, 0.0))
    across = np.linspace(-width, width, offsets + 2)[1:-1]
    directions = 2 * math.pi * np.arange(azimuths) / azimuths
    azimuth = np.repeat(directions, offsets)
    offset = np.tile(across, azimuths)[:, None]
    level = np.zeros(len(azimuth))
    forward = np.column_stack([np.cos(azimuth), np.sin(azimuth), level])
    left = np.column_stack([-np.sin(azimuth), np.cos(azimuth), level])
    starts = offset * left - BEFORE * forward + np.array([0.0, 0.0, HEIGHT])
    rays = Rays.uniform(starts, forward, max_range=WALL, power=POWER)
    traces = tracer_of(Scene("plant", "Plant", tuple(parts))).trace(rays)
    shape = (azimuths, offsets)
    ranges = np.minimum(traces.ranges, WALL).reshape(shape)
    spent = (traces.outcomes == Outcome.SPENT).reshape(shape)
    return PlantRanges(across, ranges, spent)


def bundle(
    centre: Floats,
    radius: float,
    rng: np.random.Generator,
    *,
    azimuths: int = 48,
    rays: int = 800,
) -> Rays:
    """Create horizontal rays through a ball from all sides."""
    first = rng.uniform(0, 2 * math.pi)
    azimuth = np.repeat(first + 2 * math.pi * np.arange(azimuths) / azimuths, rays)
    count = np.tile(np.arange(rays), azimuths)
    # Fermat spirals, which have uniform density, each rotated at random.
    offset = radius * np.sqrt((count + rng.random(len(count))) / rays)
    golden = math.pi * (3 - math.sqrt(5))
    angle = golden * count + np.repeat(rng.uniform(0, 2 * math.pi, azimuths), rays)
    directions = np.column_stack(
        [np.cos(azimuth), np.sin(azimuth), np.zeros(len(azimuth))]
    )
    left = np.column_stack([-directions[:, 1], directions[:, 0], directions[:, 2]])
    sideways = offset * np.cos(angle)
    starts = centre - (radius + 1) * directions + sideways[:, None] * left
    starts[:, 2] += offset * np.sin(angle)
    return Rays.uniform(starts, directions, max_range=2 * radius + 2, power=POWER)


def transmission(parts: Sequence[Part], rays: Rays) -> Floats:
    """Return the share of power that each ray has left behind all parts, (N,)."""
    traces = tracer_of(Scene("plant", "Plant", tuple(parts))).trace(rays)
    passed = traces.outcomes == Outcome.NOTHING
    return np.where(passed, traces.power, 0.0) / rays.power


def transmission_of_ball(opacity: float) -> float:
    """Return the mean transmission of a bare ball, which has a closed form."""
    if opacity >= 1:
        # Beams near the centre lose everything; only those at the rim get through.
        return 1 / (3 * opacity**2)
    return 1 - 2 * opacity / 3


def calibrate(
    parts: Callable[[float], Sequence[Part]], target: float, rays: Rays, highest: float
) -> float:
    """Return the loss of foliage that results in a mean transmission, by bisection."""
    low, high = 0.0, highest
    limits = [float(transmission(parts(end), rays).mean()) for end in (low, high)]
    if not limits[0] >= target >= limits[1]:
        raise ValueError(f"transmission from {limits}, expected {target:.4f} between")
    while high - low > ACCURACY * high:
        middle = (low + high) / 2
        if transmission(parts(middle), rays).mean() > target:
            low = middle
        else:
            high = middle
    return (low + high) / 2


@dataclass(frozen=True, eq=False)
class Comparison:
    """One of the three shapes, calibrated."""

    shape: str
    plant: Plant
    foliage: Material
    transmission: float
    ranges: PlantRanges

    @property
    def title(self) -> str:
        """The shape, and the loss of its foliage."""
        if self.foliage.sheet_loss is not None:
            return f"{self.shape}, each takes {self.foliage.sheet_loss:g}"
        return f"{self.shape}, takes {self.foliage.density:g} per metre"


def foliage_material(shape: str, loss: float) -> Material:
    """Create the material of a shape's foliage."""
    name = f"foliage_{shape}"
    if shape == "leaves":
        return Material(name, density=0.0, sheet_loss=loss)
    return Material(name, density=loss)


def compare_shapes(
    seed: int,
    species: Species = SHRUB,
    *,
    rays: int = RAYS,
    azimuths: int = 72,
) -> Iterator[Comparison]:
    """Calibrate the three shapes of a shrub, and measure their ranges."""
    target = target_transmission(species)
    crown = (species.centre, species.crown_radius)
    # Other rays than those of the calibration, which fits its own too well.
    first, second = (
        bundle(*crown, generator_for(seed, name), azimuths=azimuths, rays=rays)
        for name in ("calibration", "measurement")
    )
    for shape, plant in make_shrubs(seed, species).items():
        highest = POWER if shape == "leaves" else MAX_DENSITY

        # Bound as defaults: a closure would see the shape of the next round.
        def parts(
            loss: float, shape: str = shape, plant: Plant = plant
        ) -> tuple[Part, Part]:
            leaves = foliage_material(shape, loss)
            return (
                Part("shrub", WOODEN, *plant[WOOD]),
                Part("shrub", leaves, *plant[LEAVES]),
            )

        # Rounded as in map files, so that the measured shapes are theirs.
        loss = float(f"{calibrate(parts, target, first, highest):.{DIGITS}g}")
        measured = float(transmission(parts(loss), second).mean())
        ranges = measure_plant(species, parts(loss))
        yield Comparison(shape, plant, foliage_material(shape, loss), measured, ranges)


def target_transmission(species: Species = SHRUB) -> float:
    """Return the mean transmission of a ball of ``DENSITY`` as large as a crown."""
    return transmission_of_ball(2 * species.crown_radius * DENSITY / POWER)


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
    highest = max(shares_of(shape.ranges)[0].max() for shape in shapes)
    for (side, plan, bars), shape in zip(grid, shapes, strict=True):
        draw_plant(side, shape.plant)
        side.set_title(shape.title, **SMALL)
        draw_plan(plan, shape)
        draw_histogram(bars, shape.ranges, 100 * highest)
    return figure


def draw_plant(axes: Axes, plant: Plant) -> None:
    """Draw a plant in sunlight as seen from the side, from -y."""
    polygons, colours, depths = [], [], []
    for name, (vertices, faces) in plant.items():
        corners = vertices[faces]
        light = brightness(corners, SUN, both_sides=True)
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


def draw_plan(axes: Axes, shape: Comparison) -> None:
    """Draw the cross-section at the scanner's height, and the rays from one side."""
    for name, (vertices, faces) in shape.plant.items():
        lines = list(slice_mesh(vertices, faces, HEIGHT))
        axes.add_collection(
            LineCollection(lines, colors=COLOURS[name], linewidths=1.1, zorder=2)
        )
    offsets, ranges = shape.ranges.offsets, shape.ranges.ranges[0]
    ends = ranges - BEFORE
    rays = [((-BEFORE, y), (x, y)) for x, y in zip(ends, offsets, strict=True)]
    axes.add_collection(
        LineCollection(rays, colors=RADAR, linewidths=0.4, alpha=0.6, zorder=1)
    )
    wall = ranges >= WALL
    axes.plot(ends[~wall], offsets[~wall], ".", color=RADAR, markersize=4, zorder=3)
    axes.plot(ends[wall], offsets[wall], ".", color=MARKER, markersize=4, zorder=3)
    side = float(np.abs(offsets).max()) + MARGIN
    axes.plot([WALL - BEFORE] * 2, [-side, side], color=MARKER, linewidth=2)
    axes.set_xlim(-2, WALL - BEFORE + MARGIN)
    axes.set_ylim(-side, side)
    axes.set_aspect("equal")
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    axes.set_title(f"rays at a height of {HEIGHT:.2f} m", **SMALL)


def shares_of(ranges: PlantRanges) -> tuple[Floats, Floats]:
    """Return the share of ranges in each bin, the wall's last, and the bins' edges."""
    edges = np.arange(BEFORE - 1 - BIN / 2, WALL + BIN, BIN)
    counts, edges = np.histogram(ranges.ranges, bins=edges)
    return counts / counts.sum(), edges


def draw_histogram(axes: Axes, ranges: PlantRanges, highest: float) -> None:
    """Draw the shares of ranges up to ``highest`` %; the last bar is the wall's."""
    shares, edges = shares_of(ranges)
    axes.bar(edges[:-2] + BIN / 2, 100 * shares[:-1], BIN, color=RADAR)
    axes.bar(edges[-2] + BIN / 2, 100 * shares[-1], BIN, color=MARKER)
    axes.annotate(
        f"wall\n{100 * shares[-1]:.0f} %",
        (WALL, 100 * shares[-1]),
        xytext=(0, 3),
        textcoords="offset points",
        ha="center",
        va="bottom",
    )
    spent = ranges.ranges[ranges.spent].std() if ranges.spent.any() else 0.0
    text = (
        f"all: {ranges.ranges.mean():.2f} ± {ranges.ranges.std():.2f} m\n"
        f"where spent: ± {spent:.2f} m"
    )
    axes.text(0.82, 0.95, text, transform=axes.transAxes, ha="right", va="top")
    axes.set_xlim(BEFORE - 1, WALL + 0.35)
    axes.set_ylim(0, 1.3 * highest)  # with space for the text
    axes.set_xlabel("range, m")
    axes.set_ylabel(f"% of rays in {BIN} m")
    axes.set_title("ranges from all sides", **SMALL)


def main() -> None:
    """Write the files, and print the calibrated losses."""
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "plants")
    out.mkdir(parents=True, exist_ok=True)
    for name, content in plant_files(SEED).items():
        (out / name).write_bytes(content)
    rays = int(sys.argv[2]) if len(sys.argv) > 2 else RAYS
    shapes = list(compare_shapes(SEED, rays=rays))
    plot_shapes(shapes).savefig(out / "shrub_shapes.png")
    print(f"wanted: mean transmission {target_transmission():.4f}")
    for shape in shapes:
        print(f"{shape.title}: mean transmission {shape.transmission:.4f}")


if __name__ == "__main__":
    main()
