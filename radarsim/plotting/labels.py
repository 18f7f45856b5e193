"""Labels of objects in a plan, placed so that no label overlaps another one.

Theory of operation
===================
The size of a text in pixels is known only after the figure is laid out, so labels are
placed last, one after the other. The candidate positions of a label are inside the
object that it names, or next to it on each side. Of the free positions, the one that
covers the smallest area of other named objects is chosen. A label that is long or has
no free position is replaced by a number, which a legend explains. A number without a
free position is left out.
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
LONGEST: Final = 24  # maximum number of letters in a label
GAP: Final = 3.0  # points between a label and the object that it names
# Possible positions of a label, best first: steps
# right and up from the middle of the labelled object.
_SIDES: Final = ((1, 0), (0, 1), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1))
_ALONG: Final = (0.0, -0.5, 0.5)  # shift along a side, as a share of its half length
_COVERED: Final = 10.0  # cost of covering only other objects, in ranks of positions


@dataclass(frozen=True, slots=True)
class Label:
    """A text that names an object in a plan.

    Attributes:
        text: The text.
        box: Bounding box of the object: least x and y, greatest x and y, m.
        is_inside: Whether the text is written inside the object if it fits.
        is_bold: Whether the text is bold.
        radius: Radius of the mark that is drawn at the object, points.
    """

    text: str
    box: tuple[float, float, float, float]
    is_inside: bool = False
    is_bold: bool = False
    radius: float = 0.0


def write_labels(
    axes: Axes, labels: Sequence[Label], *, numbered: bool = False
) -> dict[int, str]:
    """Write labels so that they overlap neither each other nor the edge of the axes.

    Args:
        axes: Axes in m, with their final limits. The function lays out their figure.
        labels: The labels, the most important ones first.
        numbered: Whether numbers replace labels that are long or have no free position.
            Otherwise long labels are cut off, and labels without position are left out.

    Returns:
        The texts of the labels that were replaced by numbers, by number from 1.
    """
    if not labels:
        return {}
    figure = figure_of(axes)
    escape_texts(figure)  # fonts cannot measure control characters
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
    """Write a label at its best free position; return whether there was one.

    Args:
        axes: The axes.
        label: The label.
        number: Row of ``named`` with the object of this label.
        named: Boxes of the objects of all labels: west, south, east, north, (N, 4)
            pixels.
        taken: Boxes of the labels written so far, (4,) pixels; this one is appended.
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
    """Return possible boxes of a label, in pixels, the best first, (4,) each.

    Args:
        label: The label.
        box: Box of the object that it names, (4,) pixels.
        text: Bounding box of the text; only its size counts.
        gap: Gap between text and object, pixels.
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
                continue  # a corner has no side to shift along
            centres.append(middle + shift)
    return [np.concatenate([c - size / 2, c + size / 2]) for c in centres]


def _is_free(place: Floats, frame: Bbox, taken: Iterable[Floats]) -> bool:
    """Return whether a box is inside the axes and overlaps no label."""
    inside = np.all(place[:2] >= frame.min) and np.all(place[2:] <= frame.max)
    return bool(inside) and not any(
        np.all(place[:2] < other[2:]) and np.all(place[2:] > other[:2])
        for other in taken
    )


def _covered(place: Floats, others: Floats) -> float:
    """Return how much of a box covers objects, as a share; overlaps count twice.

    Objects that contain the whole box, such as a cloud, do not count.
    """
    size = np.minimum(place[2:], others[:, 2:]) - np.maximum(place[:2], others[:, :2])
    areas = np.prod(np.clip(size, 0, None), axis=1) / np.prod(place[2:] - place[:2])
    return float(areas[areas < 1 - 1e-9].sum())
