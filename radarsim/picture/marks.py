"""Echoes as markers."""

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from radarsim.geometry import Floats
from radarsim.picture.legend import Legend
from radarsim.picture.places import echo_points
from radarsim.raycast.penetration import EventKind
from radarsim.sensors.echoes import Echoes
from radarsim.sensors.scan import Scan


class Shape(NamedTuple):
    """How echoes of one kind look.

    Attributes:
        text: What the legend says.
        marker: Of matplotlib.
        filled: Whether in colour, or only its outline.
        area: Square points, of the strongest echo.
    """

    text: str
    marker: str
    filled: bool
    area: float


SHAPES: Final = {
    EventKind.ENTER: Shape("enters a volume", "^", filled=False, area=16),
    EventKind.LEAVE: Shape("leaves a volume", "v", filled=False, area=16),
    EventKind.SHEET: Shape("crosses a sheet", "D", filled=False, area=14),
    EventKind.HIT: Shape("hits", "s", filled=True, area=18),
    EventKind.SPENT: Shape("is spent", "x", filled=True, area=34),
    EventKind.RAIN: Shape("rain shows", "*", filled=True, area=24),
}
WEAKEST: Final = 0.3  # area of an echo without strength, as a share


def draw_echoes(
    axes: Axes, scan: Scan, colours: Mapping[str, str], legend: Legend
) -> set[str]:
    """Draw the echoes that the sensor keeps.

    One collection of markers is added for each kind and material, labelled with both.

    Returns:
        The names of the materials that the echoes came from.
    """
    echoes = scan.echoes
    points, areas = echo_points(scan, echoes), _areas(echoes)
    told = {part: target.material for part, target in echoes.targets.items()}
    met = np.array([told[part] for part in echoes.parts.tolist()], np.str_)
    for kind, shape in SHAPES.items():
        for material in sorted(set(told.values())):
            chosen = (echoes.kinds == kind) & (met == material)
            if chosen.any():
                colour = colours[material]
                axes.scatter(
                    points[chosen, 0],
                    points[chosen, 1],
                    areas[chosen],
                    marker=shape.marker,
                    facecolors=colour if shape.filled else "none",
                    edgecolors=None if shape.filled else colour,
                    linewidths=0.7,
                    label=f"{shape.text}: {material}",
                    zorder=3,
                )
    _tell_kinds(legend, echoes)
    return set(told.values())


def _areas(echoes: Echoes) -> Floats:
    """Give the sizes of markers, (E,) square points: stronger echoes are larger."""
    shares = WEAKEST + (1 - WEAKEST) * np.clip(echoes.strength, 0.0, 1.0)
    full = np.array([SHAPES[EventKind(kind)].area for kind in echoes.kinds.tolist()])
    return np.asarray(full * shares)


def _tell_kinds(legend: Legend, echoes: Echoes) -> None:
    kinds = set(echoes.kinds.tolist())
    if not kinds:
        return
    legend.head("Echoes (larger: stronger)")
    for kind, shape in SHAPES.items():
        if kind in kinds:
            fill = "black" if shape.filled else "none"
            legend.mark(
                shape.text,
                shape.marker,
                markeredgecolor="black",
                markerfacecolor=fill,
                markersize=5,
            )
