"""Panels next to each other at one scale, laid out in whole pixels, with a legend.

Plots of runs and maps share this layout: panels of equal size, so that they can be
compared, each with a title above it, and one legend below all of them.
"""

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.transforms import Bbox, offset_copy
from numpy.typing import NDArray

from radarsim.plotting.film import FrameCanvas, Pixels
from radarsim.plotting.palette import MARKER
from radarsim.plotting.style import round_length

DPI: Final = 110
EVEN: Final = 2  # pixels; sides of frames of a film are even
_WEST, _EAST, _GAP = 4.4, 1.6, 4.4  # margins and gap, in text heights
_TICKS: Final = 3.6  # text heights below the panels
_TOP: Final = 2.8  # text heights above the panels, for a title
_LINE: Final = 1.4  # text heights of a subtitle
_TITLE: Final = 1.2  # size of a title, relative to the text
_PAD: Final = 6.0  # points between a title and its panel
_BAR_SHARE: Final = 0.15  # largest share of a panel's width for the scale bar
_SCALE_TEXT: Final = 4.5  # text heights; width of the scale bar's label
_STATUS: Final = 20.0  # text heights; usual width of a film's subtitle
_LEGEND_MARGIN: Final = 0.6  # text heights on each side of the legend
_ZOOM: Final = 1.15  # extra zoom, so that a film does not zoom at every scan
_NARROWEST: Final = 640  # pixels; least width of the figure


class Panels:
    """A figure with several panels of the same scale.

    Attributes:
        figure: The figure.
        axes: Axes of the panels, from left to right.
        titles: Titles of the panels; their text may change.
        subtitles: Second lines of the panels; their text may change.
        scale_bar: The artists of the scale bar in the first panel.
    """

    def __init__(
        self,
        extent: Bbox,
        pixels_per_metre: float,
        titles: Sequence[str],
        subtitles: Sequence[str] = (),
        *,
        text: float = 10.0,
        numbers: bool = False,
    ) -> None:
        """Create panels without content.

        Args:
            extent: Extent of each panel.
            pixels_per_metre: Scale of the panels.
            titles: One line for each panel.
            subtitles: A second line for each panel; empty for no such lines.
            text: Size of the text, points.
            numbers: Whether to write coordinates along the panels.
        """
        self._text, self._numbers = text, numbers
        self.figure = Figure(dpi=DPI)
        self.axes: list[Axes] = []
        self.titles: list[Text] = []
        # Sizes are rounded up to whole pixels, with a tolerance for rounding errors.
        self._size = (
            math.ceil(extent.width * pixels_per_metre - 1e-6),
            math.ceil(extent.height * pixels_per_metre - 1e-6),
        )
        for title in titles:
            axes = self.figure.add_axes((0, 0, 1, 1))
            if numbers:
                axes.set_xlabel("x, m", fontsize=text)
                axes.tick_params(labelsize=text)
            else:
                axes.set(xticks=[], yticks=[])
            axes.set_xlim(extent.x0, extent.x1)
            axes.set_ylim(extent.y0, extent.y1)
            self.titles.append(self._write_title(axes, title, _PAD))
            self.axes.append(axes)
        if numbers:
            self.axes[0].set_ylabel("y, m", fontsize=text)
        self.scale_bar: list[Artist] = []
        self._draw_scale()
        self.subtitles: list[Text] = [
            axes.annotate(
                subtitle,
                (0.0, 1.0),
                xytext=(0.0, _PAD),
                xycoords="axes fraction",
                textcoords="offset points",
                fontsize=text,
                parse_math=False,
            )
            for axes, subtitle in zip(self.axes, subtitles, strict=bool(subtitles))
        ]
        heads = [*self.titles, *self.subtitles]
        self._widest = float(max(_size_of(each, self.figure).width for each in heads))
        lines = bool(subtitles) + self._is_crowded
        for axes, written in zip(self.axes, self.titles, strict=True):
            self._write_title(axes, written.get_text(), _PAD + _LINE * text * lines)
        for line in self.subtitles:  # above the scale bar, if they would overlap
            line.set_position((0.0, _PAD + _LINE * text * self._is_crowded))
        self._top = self._pixels(_TOP + _LINE * lines)
        self._place(0)

    @property
    def _is_crowded(self) -> bool:
        """Whether a line above a panel would overlap the scale bar.

        Subtitles of films are not known yet, so their usual width is assumed.
        """
        across = self._size[0]
        scale = _BAR_SHARE * across + self._pixels(_SCALE_TEXT)
        is_known = all(each.get_text() for each in self.subtitles)
        widest = self._widest if is_known else max(self._widest, self._pixels(_STATUS))
        return widest + scale > across

    def add_legend(self, rows: Sequence[Artist]) -> None:
        """Place a legend below the panels, in as many lines as its rows need."""
        # The size of a legend is known only after it is
        # drawn, so layouts are tried, the widest first.
        for columns in range(len(rows), 0, -1):
            legend = self.figure.legend(
                handles=list(rows),
                loc="lower center",
                ncols=columns,
                fontsize=self._text,
                columnspacing=1.5,
                handlelength=1.6,
                frameon=False,
            )
            box = _size_of(legend, self.figure)
            room = self.figure.bbox.width - 2 * self._pixels(_LEGEND_MARGIN)
            if box.width <= room or columns == 1:
                break
            legend.remove()
        narrowest = math.ceil(box.width) + 2 * self._pixels(_LEGEND_MARGIN)
        self._place(math.ceil(box.height), narrowest)

    def show(self, extent: Bbox) -> None:
        """Extend all panels to show an extent; reduce their scale if necessary."""
        shown = self.axes[0].viewLim.frozen()
        wanted = Bbox.union([shown, extent])
        if np.array_equal(wanted, shown):
            return
        share = max(wanted.width / shown.width, wanted.height / shown.height) * _ZOOM
        middle_x = (wanted.x0 + wanted.x1) / 2
        middle_y = (wanted.y0 + wanted.y1) / 2
        # Both axes are scaled by one factor, so
        # that a metre has the same length on both.
        across, up = shown.width * share / 2, shown.height * share / 2
        for axes in self.axes:
            axes.set_xlim(middle_x - across, middle_x + across)
            axes.set_ylim(middle_y - up, middle_y + up)
        self._draw_scale()

    def render(self, moving: Sequence[Artist], title: str, status: str) -> Pixels:
        """Return a film frame, (H, W, 3), of a figure with a single panel.

        Args:
            moving: Artists of the panel that may have changed.
            title: The new title.
            status: The new line below the title.
        """
        self.titles[0].set_text(title)
        self.subtitles[0].set_text(status)
        texts = (*self.titles, *self.subtitles)
        return self._canvas.render([*moving, *self.scale_bar, *texts])

    @cached_property
    def _canvas(self) -> FrameCanvas:
        return FrameCanvas(self.figure)

    def _draw_scale(self) -> None:
        for artist in self.scale_bar:
            artist.remove()
        # The scale bar is drawn above the right corner of a panel, where it covers
        # nothing. ``annotations.draw_scale_bar`` would draw it over cells of the map.
        axes = self.axes[0]
        west, east = axes.get_xlim()
        length = round_length(_BAR_SHARE * (east - west))
        place = offset_copy(
            axes.get_xaxis_transform(), self.figure, y=_PAD, units="points"
        )
        bar = Line2D(
            [east - length, east],
            [1.0, 1.0],
            color=MARKER,
            linewidth=3,
            solid_capstyle="butt",
            transform=place,
            clip_on=False,
        )
        axes.add_artist(bar)
        text = axes.annotate(
            f"{length:g} m",
            (east - length, 1.0),
            xytext=(-5, _PAD - 3),
            xycoords=axes.get_xaxis_transform(),
            textcoords="offset points",
            ha="right",
            fontsize=self._text,
            annotation_clip=False,
        )
        self.scale_bar = [bar, text]

    def _write_title(self, axes: Axes, text: str, pad: float) -> Text:
        return axes.set_title(
            text,
            loc="left",
            fontsize=self._text * _TITLE,
            fontweight="bold",
            pad=pad,
            parse_math=False,
        )

    def _place(self, legend_height: int, narrowest: int = _NARROWEST) -> None:
        across, up = self._size
        count = len(self.axes)
        sides = (_WEST, _GAP, _EAST) if self._numbers else (_EAST, _EAST, _EAST)
        west, gap, east = (self._pixels(each) for each in sides)
        inner = west + count * across + (count - 1) * gap + east
        beyond = max(0, math.ceil(self._widest) - across)  # title width over the panel
        width = _even(max(inner + 2 * beyond, narrowest, _NARROWEST))
        bottom = self._pixels(_TICKS if self._numbers else 1.0) + legend_height
        height = _even(bottom + up + self._top)
        self.figure.set_size_inches(width / DPI, height / DPI)
        left = west + (width - inner) // 2
        for axes in self.axes:
            place = (left / width, bottom / height, across / width, up / height)
            axes.set_position(place)
            left += across + gap

    def _pixels(self, lines: float) -> int:
        """Convert a length from multiples of the text height to pixels."""
        return round(lines * self._text * DPI / 72)


def titles_of(views: Sequence[Any]) -> tuple[list[str], list[str]]:
    """Return the titles and the subtitles of views; no subtitles if all are empty."""
    subtitles = [view.subtitle for view in views]
    return [view.title for view in views], subtitles if any(subtitles) else []


def add_cell_image(axes: Axes, *, zorder: float) -> AxesImage:
    """Add an image of square cells, drawn without interpolation."""
    image = AxesImage(axes, origin="lower", interpolation="nearest", zorder=zorder)
    axes.add_artist(image)
    return image


def show_cells(image: AxesImage, cells: NDArray[np.uint8], extent: Bbox) -> None:
    """Set the cells that an image shows.

    Args:
        image: The image.
        cells: Colours, (R, C, 3), or with opacities, (R, C, 4); the first row is the
            southernmost.
        extent: Extent of the cells, m.
    """
    image.set_data(cells)
    image.set_extent((*extent.intervalx, *extent.intervaly))


def _even(pixels: float) -> int:
    return math.ceil(pixels / EVEN) * EVEN


def _size_of(artist: Legend | Text, figure: Figure) -> Bbox:
    canvas: Any = FigureCanvasAgg(figure)  # some matplotlib methods have no types
    return artist.get_window_extent(canvas.get_renderer())
