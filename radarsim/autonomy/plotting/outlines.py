"""True outlines of a scene at the height of a sensor, as areas and lines."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import shapely
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.transforms import Bbox
from shapely import Geometry

from radarsim.autonomy.evaluation.map_score import class_of
from radarsim.autonomy.mapping.occupancy_grid import CellClass
from radarsim.geometry import Floats
from radarsim.plotting.palette import FAMILY_COLOURS, MARKER, Family, family_of
from radarsim.robots.obstacles import enclosed_area, slice_mesh
from radarsim.scene.scene import Part, Scene

_EDGE: Final = 0.3  # m around objects that are shown whole
_MUCH_LARGER: Final = 1.5  # times; greatest enlargement of an extent along a side


@dataclass(frozen=True, slots=True)
class Outline:
    """The outlines of all objects of one kind and one family of materials.

    Attributes:
        kind: Class of the objects on a map: obstacle, foliage or smoke.
        lines: Outlines, (N, 2) m each, map frame; overlapping objects have a common
            outline.
        family: The family of materials, which gives the colour.
    """

    kind: CellClass
    lines: tuple[Floats, ...]
    family: Family = Family.STONE


def outlines_of(scene: Scene, height: float) -> tuple[Outline, ...]:
    """Return the outlines of a scene at a height, by kind of object and family.

    Args:
        scene: The map.
        height: Height of the cut, m, map frame.
    """
    found = []
    for kind in (CellClass.SMOKE, CellClass.FOLIAGE, CellClass.OBSTACLE):
        parts = [part for part in scene.parts if class_of(part.material) == kind]
        for family in Family:
            alike = (part for part in parts if family_of(part.material) == family)
            if lines := _outline(alike, height):
                found.append(Outline(kind, lines, family))
    return tuple(found)


def outlines_extent(outlines: Iterable[Outline]) -> Bbox | None:
    """Return the extent of all outlines, m; None without outlines."""
    lines = [line for outline in outlines for line in outline.lines]
    if not lines:
        return None
    return box_around(np.concatenate(lines))


def box_around(points: Floats) -> Bbox:
    """Return the smallest box around points, (N, 2) m."""
    return Bbox(np.array([points.min(axis=0), points.max(axis=0)]))


def include_touched(extent: Bbox, outlines: Iterable[Outline]) -> Bbox:
    """Return an extent, enlarged so that it shows objects at its edge as a whole.

    Objects that are too large, such as the walls around a room, stay cut off.
    """
    wanted = extent
    for outline in outlines:
        for line in outline.lines:
            box = box_around(line)
            whole = Bbox.union([extent, box.padded(_EDGE)])
            larger = max(whole.width / extent.width, whole.height / extent.height)
            # Walls of a large room do not enlarge the
            # extent, since the run would then look tiny.
            if box.fully_overlaps(extent) and larger <= _MUCH_LARGER:
                wanted = Bbox.union([wanted, whole])
    return wanted


def _outline(parts: Iterable[Part], height: float) -> tuple[Floats, ...]:
    areas: list[Geometry] = []
    lines: list[Floats] = []
    for part in parts:
        segments = slice_mesh(part.vertices, part.faces, height)
        area = enclosed_area(segments)
        if shapely.is_empty(area):  # a surface that encloses no area
            lines += list(segments)
        else:
            areas.append(area)
    together = shapely.boundary(shapely.union_all(areas))
    lines += [shapely.get_coordinates(line) for line in shapely.get_parts(together)]
    return tuple(lines)


def draw_areas(axes: Axes, outlines: Iterable[Outline]) -> list[PathPatch]:
    """Draw objects as filled areas, each family in its colour.

    Args:
        axes: Axes in m, map frame.
        outlines: The outlines to draw.

    Returns:
        The drawn patches.
    """
    drawn = []
    for outline in outlines:
        path = Path.make_compound_path(*(Path(line) for line in outline.lines))
        # Foliage and smoke are drawn below the sensed cells, and walls above them.
        order = 2.7 if outline.kind == CellClass.OBSTACLE else 1.0
        drawn.append(PathPatch(path, **_area_style(outline.family), zorder=order))
        axes.add_patch(drawn[-1])
    return drawn


def area_rows(outlines: Iterable[Outline]) -> list[Artist]:
    """Return the legend rows for filled areas, one for each family."""
    families = {outline.family for outline in outlines}
    return [
        Patch(**_area_style(family), label=family.value)
        for family in Family
        if family in families
    ]


def _area_style(family: Family) -> dict[str, Any]:
    colour = FAMILY_COLOURS[family]
    return {"facecolor": colour, "edgecolor": MARKER, "linewidth": 0.8}
