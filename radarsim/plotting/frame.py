"""The frame of a picture: a plan, its title above it, and a legend on the right.

Plans of equal limits have equal frames, to the pixel, whatever is written around them,
so that pictures of several sensors can be compared by turning pages.
"""

import textwrap
from typing import Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from radarsim.plotting.style import write_title

# All in inches.
_LARGEST: Final = (9.4, 6.6)  # of a plan
_NARROWEST: Final = 4.0  # width that a plan has, for the title above it
_LOWEST: Final = 3.2  # height of the figure, for the legend
_LEGEND: Final = 2.6  # on the right
_LEFT, _LEFT_OF_NUMBERS = 0.15, 0.6
_BOTTOM, _NUMBERS = 0.12, 0.25  # below the small print, and between it and the plan
_LINE, _SMALL_LINE = 0.25, 0.15  # heights of lines of the title and the small print
_LETTER: Final = 0.155  # width of a letter of the title, on average
_SMALL_LETTER: Final = 0.075  # likewise, of the small print
_TITLE_LINES, _SMALL_LINES = 2, 2  # that have room in each frame


def fit_plan(figure: Figure, axes: Axes, *, coordinates: bool = False) -> None:
    """Give a figure the size of its plan with title and legend; wrap long lines.

    Args:
        figure: The figure, without a layout engine.
        axes: Its axes, with their final limits, and the title and the small print that
            ``write_title`` wrote.
        coordinates: Whether there are numbers beside the axes.
    """
    (west, east), (south, north) = axes.get_xlim(), axes.get_ylim()
    aspect = (east - west) / (north - south)
    wide = min(_LARGEST[0], _LARGEST[1] * aspect)
    tall = wide / aspect
    left = _LEFT_OF_NUMBERS if coordinates else _LEFT
    width = left + max(wide, _NARROWEST) + _LEGEND
    # By the mean width of letters: the true one is known only when the figure is drawn.
    title = textwrap.wrap(axes.get_title(loc="left"), int(width / _LETTER))
    small_print = textwrap.wrap(axes.get_xlabel(), int(width / _SMALL_LETTER))
    write_title(axes, "\n".join(title), "\n".join(small_print))
    bottom = _BOTTOM + _SMALL_LINE * max(len(small_print), _SMALL_LINES)
    bottom += _NUMBERS if coordinates else 0.0
    top = _LINE * max(len(title), _TITLE_LINES) + _BOTTOM
    height = max(bottom + tall + top, _LOWEST)
    figure.set_size_inches(width, height)
    axes.set_position((left / width, bottom / height, wide / width, tall / height))
