"""What pictures of plans say: a title in words, names at places, and a scale bar."""

import math
from typing import Any, Final

from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke

from radarsim.plotting.palette import MARKER

HALO: Final = withStroke(linewidth=3, foreground="white")
SMALL_PRINT: Final = 8.0  # points
QUIET: Final = "0.35"  # colour of small print
_BAR_SHARE: Final = 0.2  # of the width of the axes that a scale bar takes at most


def as_words(name: str) -> str:
    """Return the name of an object or a material as words.

    >>> as_words("crate_low")
    'crate low'
    """
    return name.replace("_", " ")


def write_title(axes: Axes, words: str, small_print: str = "") -> None:
    """Write what one sees large above a drawing, and its parameters small below it."""
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
    """Write a text, some points beside a place in the units of the axes.

    Args:
        axes: The axes.
        text: The text.
        place: The place.
        offset: How far to its right and above it, points.
        **style: Of the text, as for ``Axes.annotate``; by default it has a halo.
    """
    style.setdefault("path_effects", [HALO])
    axes.annotate(text, place, xytext=offset, textcoords="offset points", **style)


def draw_scale_bar(axes: Axes) -> float:
    """Draw a scale bar in the lower left corner, and hide the numbers of the axes.

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
    """Return the largest of 1, 2 or 5 times a power of ten that is not longer.

    >>> round_length(3.7), round_length(0.6), round_length(50)
    (2.0, 0.5, 50.0)
    """
    power = 10.0 ** math.floor(math.log10(longest))
    return max(step * power for step in (1, 2, 5) if step * power <= longest)
