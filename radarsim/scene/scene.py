"""What there is: parts with their materials, and the places where robots start."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from radarsim.geometry import Floats, Pose3
from radarsim.scene.material import Material
from radarsim.scene.shapes import Faces
from radarsim.scene.topology import Labels, is_closed, label_components


@dataclass(frozen=True, eq=False)
class Part:
    """The surfaces of one object that are of one material.

    Arrays are brought to their dtypes and made read-only.

    Attributes:
        object_name: The object's name in the map file.
        material: What it is made of.
        vertices: (V, 3) float64 m, map frame.
        faces: (F, 3) int32 rows of vertex numbers; wound outward where the inside
            counts, with cavities wound the other way round.

    Raises:
        ValueError: If an array has another shape, a vertex is not finite, or a face
            names a vertex that is not there.
    """

    object_name: str
    material: Material
    vertices: Floats
    faces: Faces

    def __post_init__(self) -> None:
        vertices = np.array(self.vertices, dtype=np.float64, order="C")
        faces = np.array(self.faces, dtype=np.int32, order="C")
        for name, array in (("vertices", vertices), ("faces", faces)):
            if array.ndim != 2 or array.shape[1] != 3:
                raise ValueError(f"{name} of shape {array.shape}, expected (N, 3)")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if not np.isfinite(vertices).all():
            raise ValueError(
                f"vertices of {self.object_name!r}, expected finite numbers"
            )
        if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
            raise ValueError(
                f"faces from {faces.min()} to {faces.max()},"
                f" expected 0 to {len(vertices) - 1}"
            )

    @cached_property
    def closed(self) -> bool:
        """Whether the surfaces enclose a volume, so that inside and outside exist."""
        return is_closed(self.faces)

    @cached_property
    def shells(self) -> Labels:
        """The shell that each face belongs to, (F,) int32, counted from 0."""
        return label_components(self.faces)


@dataclass(frozen=True, slots=True)
class StartPose:
    """A named place where a robot can start; its z is the floor's height there."""

    name: str
    pose: Pose3


@dataclass(frozen=True, slots=True)
class Trial:
    """What a robot that finds its way is to do.

    Attributes:
        start: The name, in any case, of the start that it sets out from.
        goal: x and y of where it is to go, m, map frame.
        safety_distance: What the map is made for, m, from the robot's centre to what
            its sensor sees.
    """

    start: str
    goal: tuple[float, float]
    safety_distance: float


@dataclass(frozen=True, eq=False)
class Scene:
    """A loaded map; immutable.

    Attributes:
        name: The stem of the map file.
        level: The name that clients are greeted with.
        parts: In the order of the map file.
        starts: In the order of the map file.
        materials: By name.
        air: What fills the whole scene, besides its parts: fog, rain; None for nothing
            that costs anything.
        trial: What to try navigation with; None if the map says nothing of it.
    """

    name: str
    level: str
    parts: tuple[Part, ...] = ()
    starts: tuple[StartPose, ...] = ()
    materials: Mapping[str, Material] = field(default_factory=dict)
    air: Material | None = None
    trial: Trial | None = None

    @cached_property
    def bounds(self) -> Floats:
        """The smallest and largest x, y, z of all parts, (2, 3) m; 0 without parts."""
        boxes = [_box(part) for part in self.parts if part.faces.size]
        if not boxes:
            return np.zeros((2, 3))
        lows, highs = np.stack(boxes, axis=1)
        return np.stack([lows.min(axis=0), highs.max(axis=0)])

    @property
    def triangles(self) -> int:
        """The number of triangles of all parts."""
        return sum(len(part.faces) for part in self.parts)

    def floor_at(self, x: float, y: float) -> float:
        """Give the floor's height at a place, m: that of the nearest start, else 0."""
        if not self.starts:
            return 0.0
        return min(
            (start.pose for start in self.starts),
            key=lambda pose: math.hypot(pose.x - x, pose.y - y),
        ).z

    def start(self, name: str) -> StartPose | None:
        """Find a start by its name, in any case; None if there is none of that name."""
        wanted = name.casefold()
        matches = (start for start in self.starts if start.name.casefold() == wanted)
        return next(matches, None)


def _box(part: Part) -> Floats:
    """Give the smallest and largest x, y, z of the vertices that have faces."""
    used = part.vertices[part.faces.ravel()]
    return np.stack([used.min(axis=0), used.max(axis=0)])
