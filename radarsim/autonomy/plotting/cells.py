"""What a run has sensed: cells where beams ended, as dots inside foliage and smoke.

The cells of a map are drawn as an image, which is fast enough for films.
"""

from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np
import shapely
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

from radarsim.autonomy.navigation.run_log import CELL, RunLog
from radarsim.autonomy.plotting.outlines import Outline
from radarsim.autonomy.plotting.panels import Extent
from radarsim.geometry import Floats
from radarsim.robots.obstacles import area_within

FAINTEST, STRONGEST = 0.12, 0.5  # opacity of cells where one, or most beams ended
_BLOCK: Final = 3  # cells along a side of a square that has one dot
_LEAST, _MOST = 0.2, 0.5  # diameter of a dot, in sides of its square
_SAMPLE: Final = 7.0  # points; of cells in the legend
_DOT_SAMPLE: Final = 3.0  # points; likewise of dots
_ENTERED: Final = {"foliage": "foliage", "cloud": "smoke"}  # kinds that beams enter
_ZORDER: Final = 2.5


class CellImage(AxesImage):
    """Square cells, each pixel in the colour of the cell at its middle.

    Matplotlib's own images filter and blend, which takes much longer.
    """

    def __init__(self, axes: Axes, *, zorder: float) -> None:
        super().__init__(axes, origin="lower", interpolation="nearest")
        self.set_zorder(zorder)
        self._cells = np.zeros((3, 3), np.uint32)
        self._shown = Extent(0.0, 0.0, 1.0, 1.0)

    def show(self, cells: NDArray[np.uint8], extent: Extent) -> None:
        """Set the cells.

        Args:
            cells: Colours, (R, C, 3), or with opacities, (R, C, 4); the first row is
                the southernmost.
            extent: Where they are, m.
        """
        rows, columns = cells.shape[:2]
        padded = np.zeros((rows + 2, columns + 2, 4), np.uint8)  # transparent beyond
        padded[1:-1, 1:-1, 3] = 255
        padded[1:-1, 1:-1, : cells.shape[2]] = cells
        # As one number each, so that a pixel is copied at once and not in four parts.
        self._cells, self._shown = padded.view(np.uint32)[:, :, 0], extent
        self.set_data(padded[1:-1, 1:-1])
        self.set_extent((extent.west, extent.east, extent.south, extent.north))

    def make_image(
        self, renderer: Any, magnification: float = 1.0, unsampled: bool = False
    ) -> tuple[NDArray[np.uint8], float, float, Affine2D]:
        """Return the pixels of the whole panel, (H, W, 4), and their lower left."""
        del renderer, unsampled
        box, shown = self.axes.bbox, self._shown
        rows, columns = (count - 2 for count in self._cells.shape)
        across = _indices(
            self.axes.get_xlim(),
            round(box.width * magnification),
            (shown.west, shown.east),
            columns,
        )
        up = _indices(
            self.axes.get_ylim(),
            round(box.height * magnification),
            (shown.south, shown.north),
            rows,
        )
        pixels = np.take(np.take(self._cells, up, axis=0), across, axis=1)
        image = np.ascontiguousarray(pixels).view(np.uint8)
        return image.reshape(len(up), len(across), 4), box.x0, box.y0, Affine2D()


def _indices(
    limits: tuple[float, float], pixels: int, span: tuple[float, float], cells: int
) -> NDArray[np.int64]:
    """Return the cell of each pixel along an axis, counted from 1; 0 is outside."""
    low, high = limits
    places: Floats = low + (np.arange(pixels) + 0.5) / pixels * (high - low)
    index = np.floor((places - span[0]) / (span[1] - span[0]) * cells)
    return np.asarray(np.clip(index, -1, cells) + 1, dtype=np.int64)


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
        self._image = CellImage(axes, zorder=_ZORDER)
        axes.add_artist(self._image)
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
        corners = (*(first * CELL).tolist(), *(last * CELL).tolist())
        self._image.show(pixels, Extent(*corners))

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
    rows = [Line2D([], [], **cell, markersize=_SAMPLE, **plain, label=label)]
    kinds = {outline.kind for outline in outlines}
    if names := [name for kind, name in _ENTERED.items() if kind in kinds]:
        dot: dict[str, Any] = {"color": colour, "marker": "o", **plain}
        label = f"sensed in {' or '.join(names)}"
        rows.append(Line2D([], [], **dot, markersize=_DOT_SAMPLE, label=label))
    return [*rows]
