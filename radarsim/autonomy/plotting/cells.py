"""What a run has sensed: cells where beams ended, as dots inside foliage and smoke."""

from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np
import shapely
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from radarsim.autonomy.navigation.run_log import CELL, RunLog
from radarsim.autonomy.plotting.outlines import Outline
from radarsim.geometry import Floats
from radarsim.robots.obstacles import area_within

FAINTEST, STRONGEST = 0.12, 0.5  # opacity of cells where one, or most beams ended
_BLOCK: Final = 3  # cells along a side of a square that has one dot
_LEAST, _MOST = 0.2, 0.5  # diameter of a dot, in sides of its square
_SAMPLE: Final = 7.0  # points; of cells in the legend
_DOT_SAMPLE: Final = 3.0  # points; likewise of dots
_ENTERED: Final = {"foliage": "foliage", "cloud": "smoke"}  # kinds that beams enter
_ZORDER: Final = 2.5


def add_cell_image(axes: Axes, *, zorder: float) -> AxesImage:
    """Add an image of square cells, each pixel in the colour of the cell below it."""
    image = AxesImage(axes, origin="lower", interpolation="nearest", zorder=zorder)
    axes.add_artist(image)
    return image


def show_cells(image: AxesImage, cells: NDArray[np.uint8], extent: Bbox) -> None:
    """Set the cells of an image.

    Args:
        image: The image.
        cells: Colours, (R, C, 3), or with opacities, (R, C, 4); the first row is the
            southernmost.
        extent: Where they are, m.
    """
    image.set_data(cells)
    image.set_extent((*extent.intervalx, *extent.intervaly))


class SensedCells:
    """Draws where beams ended, the stronger the more often they did.

    Cells in the open are tinted. A tint over foliage would look like another material,
    so there each square of a few cells has a dot, which leaves its green as it is.
    """

    def __init__(self, axes: Axes, colour: str, outlines: Sequence[Outline]) -> None:
        """Draw nothing yet.

        Args:
            axes: The panel, m, map frame, with its limits.
            colour: Colour of what is sensed.
            outlines: What is truly there.
        """
        self._axes, self._colour = axes, colour
        self._image = add_cell_image(axes, zorder=_ZORDER)
        entered = [each for each in outlines if each.kind in _ENTERED]
        lines = [shapely.linestrings(line) for each in entered for line in each.lines]
        self._entered = area_within(shapely.geometrycollections(lines))
        shapely.prepare(self._entered)
        self._dots: list[Artist] = []

    def update(self, run_log: RunLog) -> None:
        """Show what a run has sensed so far, as far as it is within the panel."""
        for artist in self._dots:
            artist.remove()
        ends = run_log.beam_ends
        # A film zooms out as the run goes on: what is outside may come into view.
        low, high = self._axes.viewLim.min, self._axes.viewLim.max
        shown = ((ends[:, :2] > low) & (ends[:, :2] < high)).all(axis=1)
        within = shapely.contains_xy(self._entered, ends[:, 0], ends[:, 1])
        most = ends[:, 2].max(initial=1.0)
        self._tint(ends[shown & ~within], most)
        self._dots = self._draw_dots(ends[shown & within], most * _BLOCK)

    @property
    def artists(self) -> list[Artist]:
        """What was drawn."""
        return [self._image, *self._dots]

    def _tint(self, ends: Floats, most: float) -> None:
        """Tint cells, (M, 3) as in ``RunLog.beam_ends``."""
        cells = np.floor(ends[:, :2] / CELL).astype(np.int64)
        if not len(cells):
            # An image has at least one cell; this one is transparent.
            cells, ends = np.zeros((1, 2), np.int64), np.zeros((1, 3))
        first, last = cells.min(axis=0), cells.max(axis=0) + 1
        columns, rows = last - first
        pixels = np.zeros((rows, columns, 4), np.uint8)
        pixels[:, :, :3] = np.round(255 * np.array(to_rgb(self._colour)))
        # By the logarithm: near the robot beams end a hundred times as often as afar.
        often = np.log1p(ends[:, 2]) / np.log1p(most)
        opacity = (FAINTEST + (STRONGEST - FAINTEST) * often) * (ends[:, 2] > 0)
        x, y = (cells - first).T
        pixels[y, x, 3] = np.round(255 * opacity)
        show_cells(self._image, pixels, Bbox(np.array([first, last]) * CELL))

    def _draw_dots(self, ends: Floats, most: float) -> list[Artist]:
        """Draw a dot in each square of cells, (M, 3), that has any."""
        if not len(ends):
            return []
        side = _BLOCK * CELL
        squares = np.floor(ends[:, :2] / side).astype(np.int64)
        places, numbers = np.unique(squares, axis=0, return_inverse=True)
        # numpy 2.0 gave the inverse another shape than versions before and after
        counts = np.bincount(numbers.reshape(-1), ends[:, 2])
        often = np.minimum(np.log1p(counts) / np.log1p(most), 1.0)
        axes, figure = self._axes, self._axes.get_figure(root=True)
        assert figure is not None
        points = side * axes.bbox.width / axes.viewLim.width * 72 / figure.dpi
        sizes = (points * (_LEAST + (_MOST - _LEAST) * often)) ** 2
        x, y = ((places + 0.5) * side).T
        style: dict[str, Any] = {"color": self._colour, "linewidths": 0.0}
        return [axes.scatter(x, y, sizes, **style, zorder=_ZORDER)]


def sensed_rows(colour: str, by: str, outlines: Iterable[Outline]) -> list[Artist]:
    """Return the rows of a legend for what is sensed.

    Args:
        colour: Its colour.
        by: The words that follow, such as `` by the radar``.
        outlines: What is truly there.
    """
    cell: dict[str, Any] = {"color": colour, "alpha": STRONGEST, "marker": "s"}
    plain: dict[str, Any] = {"markeredgewidth": 0.0, "linestyle": "none"}
    label = f"sensed{by}"
    rows: list[Artist] = [
        Line2D([], [], **cell, markersize=_SAMPLE, **plain, label=label)
    ]
    kinds = {outline.kind for outline in outlines}
    if names := [name for kind, name in _ENTERED.items() if kind in kinds]:
        dot: dict[str, Any] = {"color": colour, "marker": "o", **plain}
        label = f"sensed in {' or '.join(names)}"
        rows.append(Line2D([], [], **dot, markersize=_DOT_SAMPLE, label=label))
    return rows
