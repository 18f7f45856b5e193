"""The scene: parts with their materials, and the poses where robots start."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

import radarsim
from radarsim.geometry import Floats, Pose3
from radarsim.scene.material import Material
from radarsim.scene.shapes import Faces

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from radarsim.scene.reflectors import Reflector

# Degrees; that of the original server: 39° 8.0273' N, 77° 12.998' W.
GPS_ORIGIN: Final = (39 + 8.0273 / 60, -77 - 12.998 / 60)


@dataclass(frozen=True, eq=False, repr=False)
class Part:
    """The surfaces of one object that have one material.

    Arrays are copied, converted to their dtypes and made read-only.

    Attributes:
        object_name: The object's name in the map file.
        material: The material of its surfaces and of the volumes that they enclose.
        vertices: (V, 3) float64 m, map frame.
        faces: (F, 3) int32 vertex indices; oriented outward if the material is
            penetrable, and inward at cavities.

    Raises:
        ValueError: If an array has another shape, a vertex is not finite, or a face
            refers to a missing vertex.
    """

    object_name: str
    material: Material
    vertices: Floats
    faces: Faces

    def __post_init__(self) -> None:
        # Copied, as a scene must not change after its tracer has been built.
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

    def __repr__(self) -> str:
        name, count = self.object_name, len(self.faces)
        return f"<Part {name}: {self.material.name}, {count} triangles>"

    @cached_property
    def bounds(self) -> Floats:
        """The smallest and largest x, y, z of its faces, (2, 3) m; inf without any."""
        # Vertices that no face has do not count: files may keep some far away.
        is_used = np.zeros(len(self.vertices), np.bool_)
        for corners in self.faces.T:  # at once, the indices would take twice the memory
            is_used[corners] = True
        used = self.vertices if is_used.all() else self.vertices[is_used]
        lows = used.min(axis=0, initial=np.inf)
        return np.stack([lows, used.max(axis=0, initial=-np.inf)])

    @cached_property
    def closed(self) -> bool:
        """Whether the surfaces enclose a volume, so that inside and outside exist."""
        from radarsim.scene.topology import is_closed  # noqa: PLC0415 - numba is slow

        return is_closed(self.faces)


@dataclass(frozen=True, slots=True)
class StartPose:
    """A named pose where a robot can start; z is the floor's height there."""

    name: str
    pose: Pose3


@dataclass(frozen=True, slots=True)
class Trial:
    """A navigation task: from a start to a goal.

    Attributes:
        start: The name of the start pose, case-insensitive.
        goal: x and y of the goal, m, map frame.
        safety_distance: The distance from the robot's centre to what its sensor sees
            that the map is designed for, m.
    """

    start: str
    goal: tuple[float, float]
    safety_distance: float


@dataclass(frozen=True, eq=False, repr=False)
class Scene:
    """A loaded map; immutable.

    Attributes:
        name: The stem of the map file.
        level: The level name that the server sends to clients.
        parts: The parts, in the order of the map file.
        starts: The start poses, in the order of the map file.
        materials: All materials by name.
        air: The material that fills the whole scene outside of its parts, such as fog
            or rain; None for clear air, which attenuates nothing.
        trial: The navigation task of the map, if it has one.
        gps_origin: Latitude and longitude of the map frame's origin, degrees.
        reflectors: The point reflectors, in the order of the map file; their hulls are
            among the parts.
    """

    name: str
    level: str
    parts: tuple[Part, ...] = ()
    starts: tuple[StartPose, ...] = ()
    materials: Mapping[str, Material] = field(default_factory=dict)
    air: Material | None = None
    trial: Trial | None = None
    gps_origin: tuple[float, float] = GPS_ORIGIN
    reflectors: tuple["Reflector", ...] = ()

    def __repr__(self) -> str:
        objects = len({part.object_name for part in self.parts})
        return f"<Scene {self.name}: {objects} objects, {len(self.starts)} starts>"

    def _repr_html_(self) -> str:
        """Return the plan as SVG, for notebooks."""
        return radarsim.as_svg(self.plot())

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the plan with the names of objects and starts.

        The section is at the height of a P3AT's scanner.

        Args:
            ax: Axes of matplotlib, in m; None for a figure of its own, with a legend.

        Returns:
            The axes; ``scene.plot().figure.savefig("plan.png")`` writes a file.
        """
        return radarsim.plot_scene(self, ax)

    @cached_property
    def bounds(self) -> Floats:
        """The smallest and largest x, y, z of all parts, (2, 3) m; 0 without parts."""
        return bounds_of(self.parts)

    @property
    def triangles(self) -> int:
        """The number of triangles of all parts."""
        return sum(len(part.faces) for part in self.parts)

    def floor_at(self, x: float, y: float) -> float:
        """Return the floor's height at the nearest start, m; 0 without starts."""
        if not self.starts:
            return 0.0
        return min(
            (start.pose for start in self.starts),
            key=lambda pose: math.hypot(pose.x - x, pose.y - y),
        ).z

    def start(self, name: str) -> StartPose | None:
        """Return the start of a name, case-insensitive; None if there is none."""
        wanted = name.casefold()
        matches = (start for start in self.starts if start.name.casefold() == wanted)
        return next(matches, None)


def bounds_of(parts: Iterable[Part]) -> Floats:
    """Return the smallest and largest x, y, z of parts, (2, 3) m; 0 without faces."""
    boxes = [part.bounds for part in parts if part.faces.size]
    if not boxes:
        return np.zeros((2, 3))
    lows, highs = np.stack(boxes, axis=1)
    return np.stack([lows.min(axis=0), highs.max(axis=0)])
