"""Functions shared by plots: titles, names, scale bar, legend, points in the map.

``render`` converts figures to files; equal figures give files with equal bytes.
"""

import io
import math
from collections.abc import Iterable, Mapping
from textwrap import fill
from typing import Any, Final, Literal

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.text import Text

from radarsim.errors import escape_lines
from radarsim.geometry import Floats
from radarsim.plotting.palette import (
    FAMILY_COLOURS,
    MARKER,
    Family,
    names_by_family,
)
from radarsim.scene.material import Material
from radarsim.sensors.beams import CENTRE, LEFT, RIGHT, pattern_of
from radarsim.sensors.scan import Echoes, Scan

FORMS: Final = ("png", "svg", "pdf")
# Metadata keys in which matplotlib would write the date or its version.
_DATES: Final = {"png": "Software", "svg": "Date", "pdf": "CreationDate"}
MAX_NAMES: Final = 8  # maximum number of materials in a row of a legend
MAX_NUMBERS: Final = 15  # maximum number of numbered labels in a legend
MAX_LETTERS: Final = 50  # maximum number of letters in the text of a numbered label
LINE_LENGTH: Final = 26  # characters in a row of a legend
SMOKE_OPACITY: Final = 0.7
OUTLINE_SHADE: Final = 0.7  # brightness of the outline of an area


HALO: Final = withStroke(linewidth=3, foreground="white")
SMALL_PRINT: Final = 8.0  # points
QUIET: Final = "0.35"  # colour of small print
_BAR_SHARE: Final = 0.2  # maximum length of a scale bar, as a share of the axes' width


def render(figure: Figure, form: str = "png", *, software: str = "radarsim") -> bytes:
    """Return a figure as the bytes of a file; equal figures give equal bytes.

    Args:
        figure: The figure.
        form: File format, one of ``FORMS``.
        software: Name of the program in a PNG file.
    """
    escape_texts(figure)
    # A figure without a layout engine may be larger than its content, so it is cropped.
    crop: Literal["tight"] | None = None
    if figure.get_layout_engine() is None:
        crop = "tight"
    data = io.BytesIO()
    metadata = {_DATES[form]: software if form == "png" else None}
    if form != "png":
        metadata["Creator"] = software
    # Without a fixed salt matplotlib writes random identifiers into SVG files.
    with rc_context({"svg.hashsalt": "radarsim"}):
        FigureCanvasAgg(figure).print_figure(
            data, format=form, metadata=metadata, bbox_inches=crop, pad_inches=0.15
        )
    return data.getvalue()


def figure_of(axes: Axes) -> Figure:
    """Return the figure that contains the axes."""
    figure = axes.get_figure(root=True)
    if figure is None:
        raise ValueError("axes without a figure, expected axes of a figure")
    return figure


def escape_texts(figure: Figure) -> None:
    """Escape unprintable characters in all texts of a figure."""
    for text in figure.findobj(Text):
        if isinstance(text, Text):
            text.set_text(escape_lines(text.get_text()))


def as_words(name: str) -> str:
    """Return the name of an object or a material as words.

    >>> as_words("crate_low")
    'crate low'
    """
    return name.replace("_", " ")


def write_title(axes: Axes, words: str, small_print: str = "") -> None:
    """Write a large title above the axes, and the small print below them."""
    axes.set_title(words, loc="left", fontsize=14, fontweight="bold", parse_math=False)
    if small_print:
        axes.set_xlabel(
            small_print, loc="left", fontsize=SMALL_PRINT, color=QUIET, parse_math=False
        )


def write_at(
    axes: Axes,
    text: str,
    place: tuple[float, float],
    *,
    offset: tuple[float, float] = (0.0, 0.0),
    **style: Any,
) -> None:
    """Write a text at an offset from a position in the units of the axes.

    Args:
        axes: The axes.
        text: The text.
        place: The position, x and y.
        offset: Offset to the right and upwards, points.
        **style: Style of the text for ``Axes.annotate``; by default it has a halo.
    """
    style.setdefault("path_effects", [HALO])
    axes.annotate(text, place, xytext=offset, textcoords="offset points", **style)


def draw_scale_bar(axes: Axes) -> float:
    """Draw a scale bar in the lower left corner, and remove the ticks of the axes.

    Args:
        axes: Axes in m, with their final limits.

    Returns:
        Length of the bar, m: 1, 2 or 5 times a power of ten.
    """
    west, east = axes.get_xlim()
    south, north = axes.get_ylim()
    length = round_length(_BAR_SHARE * (east - west))
    x, y = west + 0.025 * (east - west), south + 0.025 * (north - south)
    axes.plot(
        [x, x + length],
        [y, y],
        color=MARKER,
        linewidth=3,
        solid_capstyle="butt",
        path_effects=[HALO],
        label="scale",
        zorder=9,
    )
    write_at(
        axes, f"{length:g} m", (x + length / 2, y), offset=(0, 3), ha="center", zorder=9
    )
    axes.set_xticks([])
    axes.set_yticks([])
    return length


def round_length(longest: float) -> float:
    """Return 1, 2 or 5 times a power of ten, the largest not above ``longest``.

    >>> round_length(3.7), round_length(0.6), round_length(50)
    (2.0, 0.5, 50.0)
    """
    power = 10.0 ** math.floor(math.log10(longest))
    return max(step * power for step in (1, 2, 5) if step * power <= longest)


class Legend:
    """Legend of a plot: rows with a sample and a text, in groups under headings.

    A text is listed only once under each heading; headings without rows are left out.
    Several panels may share a legend.

    Attributes:
        ray_colour: Colour of samples of rays; None for the colour of their sensor.
    """

    def __init__(self, ray_colour: str | None = None) -> None:
        """Create a legend without rows.

        Args:
            ray_colour: Colour of samples of rays; None for the colour of their sensor.
        """
        self.ray_colour = ray_colour
        self._groups: dict[str, dict[str, Artist]] = {"": {}}
        self._heading = ""

    def add_heading(self, text: str) -> None:
        """Start a group of legend rows under a heading, or continue this group."""
        self._heading = text
        self._groups.setdefault(text, {})

    def add_line(self, text: str, **style: Any) -> None:
        """Add a legend row with a sample of a line."""
        self._add(text, Line2D([], [], **style))

    def add_marker(self, text: str, marker: str, **style: Any) -> None:
        """Add a legend row with a sample of a marker."""
        self._add(text, Line2D([], [], marker=marker, linestyle="none", **style))

    def add_materials(self, materials: Iterable[Material]) -> None:
        """Add a legend row for each family: its colour and the names of materials."""
        names = names_by_family(materials)
        for family in Family:
            if family in names:
                self._add(_listed(names[family]), Patch(**area_style(family)))

    def add_numbers(self, texts: Mapping[int, str]) -> None:
        """Add a legend row with the text of each numbered label, to ``MAX_NUMBERS``."""
        style = {"color": MARKER, "markersize": 7, "markeredgewidth": 0.0}
        for number, text in list(texts.items())[:MAX_NUMBERS]:
            self.add_marker(shorten(text, MAX_LETTERS), f"${number}$", **style)
        if len(texts) > MAX_NUMBERS:
            self.add_marker(f"and {len(texts) - MAX_NUMBERS} more", "")

    def draw(self, figure: Figure, columns: int = 1) -> None:
        """Draw the legend outside of the axes, if it has any rows.

        Args:
            figure: The figure. Without a layout engine the legend begins at the right
                edge of its axes.
            columns: 1 for a legend on the right; more for a legend at the bottom,
                without headings.
        """
        rows: list[tuple[str, Artist, bool]] = []  # text, sample, whether a heading
        for heading, group in self._groups.items():
            if heading and group and columns == 1:
                rows.append((heading, Line2D([], [], linestyle="none"), True))
            rows += [(text, sample, False) for text, sample in group.items()]
        if not rows:
            return
        side = "lower center" if columns > 1 else "right center"
        place: dict[str, Any] = {"loc": f"outside {side}", "ncols": columns}
        if figure.get_layout_engine() is None:
            edge = max(axes.get_position().x1 for axes in figure.axes)
            place = {"loc": "center left", "bbox_to_anchor": (edge, 0.5)}
        legend = figure.legend(
            [sample for _, sample, _ in rows],
            [" "] * len(rows),  # matplotlib hides texts that begin with "_"
            fontsize="small",
            frameon=False,
            **place,
        )
        labels = zip(legend.get_texts(), rows, strict=True)
        for label, (text, _, is_heading) in labels:
            label.set_text(fill(text, LINE_LENGTH))
            # Matplotlib would show text between dollar signs in a name as a formula.
            label.set_parse_math(False)
            if is_heading:
                label.set_fontweight("bold")

    def _add(self, text: str, sample: Artist) -> None:
        self._groups[self._heading].setdefault(text, sample)


def _listed(names: list[str]) -> str:
    """Return a text of names with commas: at most ``MAX_NAMES``, each shortened."""
    shown = [shorten(name, LINE_LENGTH) for name in names[:MAX_NAMES]]
    if len(names) > MAX_NAMES:
        shown.append(f"and {len(names) - MAX_NAMES} more")
    return ", ".join(shown)


def shorten(text: str, longest: int) -> str:
    """Return a text cut to a maximum length, with an ellipsis if it was longer."""
    return text if len(text) <= longest else f"{text[: longest - 1]}…"


def area_style(family: Family) -> dict[str, Any]:
    """Return the matplotlib style of areas that show a family of materials.

    The outline is a darker shade of the fill; smoke, dust and rain are translucent.
    """
    colour = to_rgb(FAMILY_COLOURS[family])
    opacity = SMOKE_OPACITY if family is Family.SMOKE else 1.0
    # The translucent fill is chosen so that it has the colour of the family on white.
    paint = tuple((part - 1 + opacity) / opacity for part in colour)
    return {
        "facecolor": (*paint, opacity),
        "edgecolor": tuple(OUTLINE_SHADE * part for part in colour),
        "linewidth": 0.6,
    }


def scan_points(scan: Scan) -> Floats:
    """Return the position of each reading of a scan, (N, 2) m, map frame.

    A beam without return ends at the maximum range.
    """
    ranges = np.where(np.isfinite(scan.ranges), scan.ranges, scan.range_max)
    return _along_beams(scan, scan.angles, ranges)


def echo_points(scan: Scan, echoes: Echoes) -> Floats:
    """Return the positions, (E, 2) m, map frame, at which echoes of a scan begin.

    If the rays of a cone are combined, the ray of an echo is unknown, so the echo is
    placed along the axis of its beam.
    """
    beams, settings = echoes.beams, echoes.settings
    one_ray = not settings.combines_rays or settings.rays_per_beam == 1
    if one_ray:
        starts, directions = scan.cast.origins[beams], scan.cast.directions[beams]
    elif settings.side_mode == "cone":
        return _along_beams(scan, scan.angles[beams], echoes.fronts)
    else:
        pattern = pattern_of(settings)
        three = [pattern.aim_side(scan.pose, side) for side in (RIGHT, CENTRE, LEFT)]
        node = echoes.sides.astype(np.int64) + 1
        starts = np.stack([rays.origins for rays in three])[node, beams]
        directions = np.stack([rays.directions for rays in three])[node, beams]
    return np.asarray((starts + echoes.fronts[:, None] * directions)[:, :2])


def _along_beams(scan: Scan, angles: Floats, ranges: Floats) -> Floats:
    """Return the points, (N, 2) m, map frame, at angles and ranges of a sensor."""
    flat = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
    offsets = (ranges[:, None] * flat) @ scan.pose.rotation().T
    return np.asarray((scan.pose.position() + offsets)[:, :2])
