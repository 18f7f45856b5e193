"""What plots share: the legend, colours of materials, and points in the map."""

from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from radarsim.geometry import Floats
from radarsim.scene.scene import Scene
from radarsim.sensors.beams import CENTRE, LEFT, RIGHT
from radarsim.sensors.echoes import ROBOT, Echoes
from radarsim.sensors.range_scanner import RangeScanner
from radarsim.sensors.scan import Scan


class Legend:
    """Legend beside a plot: samples with texts, in groups under headings."""

    def __init__(self) -> None:
        self._rows: list[tuple[Line2D, str]] = []
        self._headings: set[str] = set()

    def add_heading(self, text: str) -> None:
        """Start a group of rows under a heading."""
        self._headings.add(text)
        self._rows.append((Line2D([], [], linestyle="none"), text))

    def add_line(self, text: str, **style: Any) -> None:
        """Add a row with a sample of a line."""
        self._rows.append((Line2D([], [], **style), text))

    def add_marker(self, text: str, marker: str, **style: Any) -> None:
        """Add a row with a sample of a marker."""
        sample = Line2D([], [], marker=marker, linestyle="none", **style)
        self._rows.append((sample, text))

    def draw(self, figure: Figure) -> None:
        """Place the legend on the right, outside of the axes."""
        samples = [sample for sample, _ in self._rows]
        legend = figure.legend(
            samples,
            [" "] * len(samples),  # matplotlib hides texts that begin with "_"
            loc="outside right upper",
            fontsize="small",
            frameon=False,
        )
        for label, (_, text) in zip(legend.get_texts(), self._rows, strict=True):
            label.set_text(text)
            label.set_parse_math(False)
            if text in self._headings:
                label.set_fontweight("bold")


# Distinct for the colour-blind, and from the red and blue of rays.
MATERIAL_COLOURS: Final = (
    "#e69f00",
    "#aa4499",
    "#117733",
    "#33bbee",
    "#8c510a",
    "#999933",
    "#44aa99",
    "#e377c2",
)
ROBOT_COLOUR: Final = "0.2"


def material_colours(scene: Scene) -> dict[str, str]:
    """Assign a colour to each material in the order of the map; they repeat after 8.

    Robots come last and have their own colour.
    """
    air = [] if scene.air is None else [scene.air.name]
    named = [*scene.materials, *(part.material.name for part in scene.parts), *air]
    colours = {
        name: MATERIAL_COLOURS[i % len(MATERIAL_COLOURS)]
        for i, name in enumerate(dict.fromkeys(named))
    }
    return {**colours, ROBOT.name: colours.get(ROBOT.name, ROBOT_COLOUR)}


def scan_points(scan: Scan) -> Floats:
    """Return the end of each range along its beam, (N, 2) m, map frame.

    A beam without return ends at the maximum range.
    """
    ranges = np.where(np.isfinite(scan.ranges), scan.ranges, scan.range_max)
    return _along_beams(scan, scan.angles, ranges)


def echo_points(scan: Scan, echoes: Echoes) -> Floats:
    """Return the places of echoes along their rays, (E, 2) m, map frame.

    Where all rays of a cone answer together, the ray of an echo is unknown; the echo is
    placed along its beam.
    """
    beams, settings = echoes.beams, echoes.settings
    one_ray = not settings.combines_rays or settings.rays_per_beam == 1
    if one_ray:
        starts, directions = scan.cast.origins[beams], scan.cast.directions[beams]
    elif settings.side_mode == "cone":
        return _along_beams(scan, scan.angles[beams], echoes.ranges)
    else:
        scanner = RangeScanner(scan.sensor, settings)
        three = [scanner.aim_one_ray(scan.pose, s)[1] for s in (RIGHT, CENTRE, LEFT)]
        node = echoes.sides.astype(np.int64) + 1
        starts = np.stack([rays.origins for rays in three])[node, beams]
        directions = np.stack([rays.directions for rays in three])[node, beams]
    return np.asarray((starts + echoes.ranges[:, None] * directions)[:, :2])


def _along_beams(scan: Scan, angles: Floats, ranges: Floats) -> Floats:
    """Return points at ranges in the sensor's plane, (N, 2) m, map frame."""
    flat = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
    offsets = (ranges[:, None] * flat) @ scan.pose.rotation().T
    return np.asarray((scan.pose.position() + offsets)[:, :2])
