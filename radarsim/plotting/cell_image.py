"""Cells of a map as an image that is drawn quickly, as films need it."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.plotting.panels import Extent


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
