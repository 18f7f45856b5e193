"""Labels that lie on no other: each finds a place at what it names, or gets a number.

Theory of operation
===================
The size of a text in pixels is known once the figure is laid out, so that labels are
placed last. One after the other takes the best place that is left: inside what it
names, or close to it on one of its sides. Of these the one wins that covers least of
what others name. A label that is long or finds no place is shortened to a number, whose
text belongs into a legend; a number that finds none either is left out.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.transforms import Bbox

from radarsim.errors import escape_lines
from radarsim.geometry import Floats
from radarsim.plotting.style import HALO, escape_texts, figure_of, shorten

SIZE: Final = 8.0  # points
LONGEST: Final = 24  # letters of a label
GAP: Final = 3.0  # points between a label and what it names
# Where a label may be, the best first: to the right and upwards of the middle.
_SIDES: Final = ((1, 0), (0, 1), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1))
_ALONG: Final = (0.0, -0.5, 0.5)  # of the way from the middle of a side to its end
_COVERED: Final = 10.0  # how much worse a place is that covers something wholly


@dataclass(frozen=True, slots=True)
class Label:
    """A text that names something in a plan.

    Attributes:
        text: The text.
        box: Least x and y of what it names, and greatest x and y, m.
        is_inside: Whether the text lies on what it names if it fits into it.
        is_bold: Whether it is written in bold.
        radius: Of a mark that is drawn there, points.
    """

    text: str
    box: tuple[float, float, float, float]
    is_inside: bool = False
    is_bold: bool = False
    radius: float = 0.0


def write_labels(
    axes: Axes, labels: Sequence[Label], *, numbered: bool = False
) -> dict[int, str]:
    """Write labels that overlap neither each other nor the edge of the axes.

    Args:
        axes: Axes in m, with their final limits; their figure is laid out for it.
        labels: The labels, the most important ones first.
        numbered: Whether numbers are written for labels that are long or find no
            place; else long ones are cut off, and what finds no place is left out.

    Returns:
        The texts of the labels that have numbers, by these, from 1.
    """
    if not labels:
        return {}
    figure = figure_of(axes)
    escape_texts(figure)  # fonts have no control characters to be measured
    figure.draw_without_rendering()
    corners = np.array([label.box for label in labels]).reshape(-1, 2)
    named = axes.transData.transform(corners).reshape(-1, 4)
    taken: list[Floats] = []
    left = []
    for number, label in enumerate(labels):
        text = escape_lines(label.text)
        is_long = len(text) > LONGEST
        short = replace(label, text=shorten(text, LONGEST))
        if (is_long and numbered) or not _write(axes, short, number, named, taken):
            left.append(number)
    texts: dict[int, str] = {}
    for number in left:
        short = replace(labels[number], text=str(len(texts) + 1))
        if numbered and _write(axes, short, number, named, taken):
            texts[len(texts) + 1] = labels[number].text
    return texts


def _write(
    axes: Axes, label: Label, number: int, named: Floats, taken: list[Floats]
) -> bool:
    """Write a label at the best place that is left; return whether there is one.

    Args:
        axes: The axes.
        label: The label.
        number: Row of ``named`` that it names.
        named: What all labels name: west, south, east and north, (N, 4) pixels.
        taken: Where labels are already, likewise; the place of this one is added.
    """
    west, south, east, north = label.box
    text = axes.annotate(
        label.text,
        ((west + east) / 2, (south + north) / 2),
        xytext=(0, 0),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=SIZE,
        fontweight="bold" if label.is_bold else "normal",
        path_effects=[HALO],
        parse_math=False,
        annotation_clip=True,
        zorder=7,
    )
    text.set_in_layout(False)
    own = text.get_window_extent()
    per_point = figure_of(axes).dpi / 72
    places = _places(label, named[number], own, GAP * per_point)
    frame = axes.get_window_extent()
    free = [place for place in places if _is_free(place, frame, taken)]
    if not free:
        text.remove()
        return False
    others = np.delete(named, number, axis=0)
    best = min(
        range(len(free)),
        key=lambda each: each + _COVERED * _covered(free[each], others),
    )
    place = free[best]
    shift = (place[:2] + place[2:] - own.min - own.max) / 2 / per_point
    text.xyann = (float(shift[0]), float(shift[1]))
    taken.append(place)
    return True


def _places(label: Label, box: Floats, text: Bbox, gap: float) -> list[Floats]:
    """Return where a label may be, the best first, (4,) pixels each.

    Args:
        label: The label.
        box: What it names, (4,) pixels.
        text: The text, wherever it is.
        gap: Between both, pixels.
    """
    size = np.array([text.width, text.height])
    middle, half = (box[:2] + box[2:]) / 2, (box[2:] - box[:2]) / 2
    fits = label.is_inside and bool(np.all(size <= 2 * half))
    centres = [middle] if fits else []
    away = half + gap * (1 + label.radius / GAP) + size / 2
    for along in _ALONG:
        for right, up in _SIDES:
            side = np.array([right, up])
            shift = np.where(side == 0, along * half, side * away)
            if along and right and up:
                continue  # a corner has no length to go along
            centres.append(middle + shift)
    return [np.concatenate([c - size / 2, c + size / 2]) for c in centres]


def _is_free(place: Floats, frame: Bbox, taken: Iterable[Floats]) -> bool:
    """Return whether a place is in the axes, and overlaps no label."""
    inside = np.all(place[:2] >= frame.min) and np.all(place[2:] <= frame.max)
    return bool(inside) and not any(
        np.all(place[:2] < other[2:]) and np.all(place[2:] > other[:2])
        for other in taken
    )


def _covered(place: Floats, others: Floats) -> float:
    """Return how much of a place lies on other things, some of it perhaps twice.

    What surrounds the place as a whole, such as a cloud, does not count.
    """
    size = np.minimum(place[2:], others[:, 2:]) - np.maximum(place[:2], others[:, :2])
    areas = np.prod(np.clip(size, 0, None), axis=1) / np.prod(place[2:] - place[:2])
    return float(areas[areas < 1 - 1e-9].sum())
