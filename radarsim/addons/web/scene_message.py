"""Messages that describe a map: its plan at scanner height, and its triangles."""

import math
from collections.abc import Iterable
from typing import Any, Final

import numpy as np
import shapely

from radarsim.addons.web.viewers import encode_json
from radarsim.geometry import Floats
from radarsim.plotting.palette import colour_of
from radarsim.robots.obstacles import enclosed_area, slice_mesh
from radarsim.scene.scene import Part, Scene

HEIGHT: Final = 0.346  # m; height of the scanner of a P3AT above the floor
_DIGITS: Final = 6  # digits of rounded line ends, so that adjacent lines share an end
_SENT_DIGITS: Final = 3  # coordinates are sent in whole millimetres


class SceneMessages:
    """The messages that describe a map to browsers.

    Attributes:
        plan: The message ``scene``, as JSON.
        triangles: The message ``triangles``, as JSON.
        materials: A legend of the materials of the map.
        safety_distance: Distance between robot centres and detected objects for which
            the map is designed, m; None if the map states none.
    """

    def __init__(self, scene: Scene) -> None:
        """Create the messages of a map."""
        plan = describe_plan(scene)
        self.plan = encode_json(plan)
        self.triangles = encode_json(describe_triangles(scene))
        self.materials = describe_materials(scene)
        trial = scene.trial
        self.safety_distance = None if trial is None else trial.safety_distance
        # The outlines of all obstacles at the height of the scanners.
        outlines = [
            (part["name"], line)
            for part in plan["parts"]
            if part["solid"]
            for line in part["outline"]
            if len(line) > 1
        ]
        self._names = [name for name, _ in outlines]
        self._tree = shapely.STRtree([shapely.LineString(line) for _, line in outlines])

    def nearest_obstacle(self, x: float, y: float) -> tuple[float, str]:
        """Return the distance to the obstacle nearest to a point, m, and its name.

        The distance is infinite if the map has no obstacles.
        """
        if not self._names:
            return math.inf, ""
        place, distance = self._tree.query_nearest(
            shapely.Point(x, y), return_distance=True, all_matches=False
        )
        return float(distance[0]), self._names[int(place[0])]


def describe_plan(scene: Scene) -> dict[str, Any]:
    """Return the message ``scene``: the plan of a map, in m, map frame.

    The outlines of a part are rings, which repeat their first point. Surfaces that
    enclose no area are open lines.
    """
    floor = scene.starts[0].pose.z if scene.starts else 0.0
    height = floor + HEIGHT
    (west, south, _), (east, north, _) = scene.bounds.tolist()
    return {
        "op": "scene",
        "level": scene.level,
        "bounds": [west, south, east, north],
        "height": height,
        "parts": [
            {
                **_head(part),
                "outline": [
                    _rounded(line).tolist()
                    for line in _lines(slice_mesh(part.vertices, part.faces, height))
                ],
            }
            for part in scene.parts
        ],
    }


def describe_triangles(scene: Scene) -> dict[str, Any]:
    """Return the message ``triangles``; its parts are in the order of the plan."""
    parts = [
        {
            **_head(part),
            "vertices": _rounded(part.vertices).reshape(-1).tolist(),
            "faces": part.faces.reshape(-1).tolist(),
        }
        for part in scene.parts
    ]
    return {"op": "triangles", "parts": parts}


def describe_materials(scene: Scene) -> list[dict[str, str]]:
    """Return the name, label and colour of each material in a map, by name."""
    used = {part.material.name: part.material for part in scene.parts}
    return [
        {"name": name, "label": name.replace("_", " "), "colour": colour_of(material)}
        for name, material in sorted(used.items())
    ]


def _head(part: Part) -> dict[str, Any]:
    material = part.material
    opaque = not material.penetrable and material.sheet_loss is None
    return {
        "name": part.object_name,
        "material": material.name,
        "opaque": opaque,
        "density": material.density,
        "solid": material.solid,
        "colour": colour_of(material),
    }


def _lines(segments: Floats) -> Iterable[Floats]:
    """Join line segments, (S, 2, 2) m, into rings, or into lines if no ring exists."""
    if not len(segments):
        return ()
    # Only the outline of the enclosed area is drawn; walls inside an obstacle are
    # omitted.
    joined = shapely.boundary(enclosed_area(segments))
    if shapely.is_empty(joined):
        ends = np.round(segments, _DIGITS)
        joined = shapely.line_merge(shapely.multilinestrings(ends))
    return (shapely.get_coordinates(line) for line in shapely.get_parts(joined))


def _rounded(numbers: Floats) -> Floats:
    rounded: Floats = np.round(numbers, _SENT_DIGITS) + 0.0  # replaces -0.0 by 0.0
    return rounded
