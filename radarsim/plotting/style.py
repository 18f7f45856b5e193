"""What is said beside a picture: rows of samples under headings."""

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
    """Collects rows in the order in which they are to be shown."""

    def __init__(self) -> None:
        self._rows: list[tuple[Line2D, str]] = []
        self._headings: set[str] = set()

    def head(self, text: str) -> None:
        """Begin a group of rows."""
        self._headings.add(text)
        self._rows.append((Line2D([], [], linestyle="none"), text))

    def line(self, text: str, **style: Any) -> None:
        """Add a row with a sample of a line."""
        self._rows.append((Line2D([], [], **style), text))

    def mark(self, text: str, marker: str, **style: Any) -> None:
        """Add a row with a sample of a marker."""
        sample = Line2D([], [], marker=marker, linestyle="none", **style)
        self._rows.append((sample, text))

    def draw(self, figure: Figure) -> None:
        """Put the rows on the right of the picture, where they cover nothing."""
        samples = [sample for sample, _ in self._rows]
        shown = figure.legend(
            samples,
            [" "] * len(samples),  # a legend leaves out what begins with a "_"
            loc="outside right upper",
            fontsize="small",
            frameon=False,
        )
        for label, (_, text) in zip(shown.get_texts(), self._rows, strict=True):
            label.set_text(text)
            label.set_parse_math(False)
            if text in self._headings:
                label.set_fontweight("bold")


# Section from picture.places.
# Where readings and echoes are in the map, and which colour is whose.

# They differ for the colour-blind too, and from the red and the blue of rays.
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
    """Give each material its colour, by its place in the map; they repeat after 8.

    Robots come last, in a colour of their own.
    """
    air = [] if scene.air is None else [scene.air.name]
    named = [*scene.materials, *(part.material.name for part in scene.parts), *air]
    colours = {
        name: MATERIAL_COLOURS[i % len(MATERIAL_COLOURS)]
        for i, name in enumerate(dict.fromkeys(named))
    }
    return {**colours, ROBOT.name: colours.get(ROBOT.name, ROBOT_COLOUR)}


def scan_points(scan: Scan) -> Floats:
    """Place readings along their beams, as a client does: (N, 2) m, map frame.

    Where nothing came back, the point is at the greatest range.
    """
    reach = np.where(np.isfinite(scan.ranges), scan.ranges, scan.range_max)
    return _along_beams(scan, scan.angles, reach)


def echo_points(scan: Scan, echoes: Echoes) -> Floats:
    """Place echoes along the rays that they came on: (E, 2) m, map frame.

    Where the many rays of a cone answer together, an echo does not tell which of them
    it came on; it is placed along its beam.
    """
    beams, settings = echoes.beams, echoes.settings
    alone = not settings.combines_rays or settings.rays_per_beam == 1
    if alone:
        starts, ways = scan.cast.origins[beams], scan.cast.directions[beams]
    elif settings.side_mode == "cone":
        return _along_beams(scan, scan.angles[beams], echoes.ranges)
    else:
        scanner = RangeScanner(scan.sensor, settings)
        three = [scanner.aim_one_ray(scan.pose, s)[1] for s in (RIGHT, CENTRE, LEFT)]
        node = echoes.sides.astype(np.int64) + 1
        starts = np.stack([rays.origins for rays in three])[node, beams]
        ways = np.stack([rays.directions for rays in three])[node, beams]
    return np.asarray((starts + echoes.ranges[:, None] * ways)[:, :2])


def _along_beams(scan: Scan, angles: Floats, ranges: Floats) -> Floats:
    """Place ranges in the sensor's plane, seen from above."""
    flat = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
    way = (ranges[:, None] * flat) @ scan.pose.rotation().T
    return np.asarray((scan.pose.position() + way)[:, :2])
