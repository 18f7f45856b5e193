"""Marks of echoes: their shape tells the kind, their colour the material."""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from radarsim.geometry import Floats
from radarsim.plotting.palette import MARKER, family_of
from radarsim.plotting.style import Legend, area_style, echo_points
from radarsim.raycast.attenuation import EventKind
from radarsim.scene.material import Material
from radarsim.sensors.echoes import ROBOT, Echoes
from radarsim.sensors.scan import Scan


class EchoMarker(NamedTuple):
    """Marker for the echoes of one kind.

    Attributes:
        text: Text of the legend.
        marker: Marker style of matplotlib.
        filled: Whether the marker is filled or only outlined.
        area: Area of the marker of the strongest echo, square points.
    """

    text: str
    marker: str
    filled: bool
    area: float


ECHO_MARKERS: Final = {
    EventKind.ENTER: EchoMarker("enters a volume", "^", filled=False, area=14),
    EventKind.LEAVE: EchoMarker("leaves a volume", "v", filled=False, area=14),
    EventKind.SHEET: EchoMarker("crosses a sheet", "D", filled=False, area=12),
    EventKind.HIT: EchoMarker("hits a surface", "s", filled=True, area=14),
    EventKind.SPENT: EchoMarker("is spent inside", "x", filled=True, area=18),
    EventKind.RAIN: EchoMarker("rain shows", "*", filled=True, area=24),
}
MIN_AREA: Final = 0.3  # share of the area that an echo without strength has


def draw_echoes(axes: Axes, scan: Scan) -> None:
    """Draw the echoes that the sensor keeps.

    Each kind and material gets its own collection of markers, labelled with both.
    """
    echoes = scan.echoes
    points, areas = echo_points(scan, echoes), _areas(echoes)
    materials = {part: material_of(echoes, part) for part in echoes.targets}
    names = np.array([materials[part].name for part in echoes.parts.tolist()], np.str_)
    found = {material.name: material for material in materials.values()}
    for kind, shape in ECHO_MARKERS.items():
        for name in sorted(found):
            chosen = (echoes.kinds == kind) & (names == name)
            if chosen.any():
                axes.scatter(
                    *(points[chosen, 0], points[chosen, 1], areas[chosen]),
                    label=f"{shape.text}: {name}",
                    **_style(shape, found[name]),
                )


def material_of(echoes: Echoes, part: int) -> Material:
    """Return the material of a part of echoes, or that of robots."""
    parts = echoes.scene_parts
    return parts[part].material if part < len(parts) else ROBOT


def _style(shape: EchoMarker, material: Material) -> dict[str, Any]:
    fill = area_style(family_of(material))
    outline = fill["edgecolor"]
    style: dict[str, Any] = {"marker": shape.marker, "linewidths": 0.7, "zorder": 3}
    if shape.marker == "x":
        return {**style, "color": outline}
    inside = fill["facecolor"][:3] if shape.filled else "none"
    return {**style, "facecolors": inside, "edgecolors": outline}


def _areas(echoes: Echoes) -> Floats:
    """Return the areas of markers, (E,) square points, larger for stronger echoes."""
    levels = 1 + echoes.decibels / echoes.settings.margin_db
    shares = MIN_AREA + (1 - MIN_AREA) * np.clip(levels, 0.0, 1.0)
    full = np.array(
        [ECHO_MARKERS[EventKind(kind)].area for kind in echoes.kinds.tolist()]
    )
    return np.asarray(full * shares)


def add_echo_rows(legend: Legend, scans: Sequence[Scan]) -> None:
    """Add the kinds of echoes that there are to a legend."""
    kinds = {kind for scan in scans for kind in scan.echoes.kinds.tolist()}
    legend.add_heading("Echoes (larger: stronger)")
    for kind, shape in ECHO_MARKERS.items():
        if kind in kinds:
            legend.add_marker(
                shape.text,
                shape.marker,
                markeredgecolor=MARKER,
                markerfacecolor="0.7" if shape.filled else "none",
                markersize=5,
            )
