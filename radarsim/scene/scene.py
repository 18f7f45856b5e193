"""Scenes: parts with materials, start poses, reflectors, victims, tags and crates."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np

import radarsim
from radarsim.geometry import Floats, Pose3
from radarsim.scene.material import Material
from radarsim.scene.shapes import Faces

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Place: TypeAlias = tuple[float, float, float]

# Latitude and longitude, degrees. The default is that of the original USARSim: 39°
# 8.0273' N, 77° 12.998' W.
GPS_ORIGIN: Final = (39 + 8.0273 / 60, -77 - 12.998 / 60)
MOST_CRATES = 20  # so that one line on the wire can list all crates
SMALLEST, LARGEST = 0.05, 10.0  # m; sides of crates

# Material of reflectors, whose faces return no echo; only a point target does.
REFLECTOR: Final = Material("reflector", backscatter_db=-math.inf)
POINT_EDGE: Final = 0.05  # m

# Positions of the body parts of a man 1.75 m tall (estimated), relative to the pelvis:
# distances towards the head, and to the left, m.
BODY_PARTS: Final = (
    ("Head", 0.75, 0.0),
    ("Chest", 0.40, 0.0),
    ("Pelvis", 0.0, 0.0),
    ("Arm", 0.35, 0.30),
    ("Arm", 0.35, -0.30),
    ("Hand", 0.0, 0.40),
    ("Hand", 0.0, -0.40),
    ("Leg", -0.45, 0.12),
    ("Leg", -0.45, -0.12),
    ("Foot", -0.90, 0.12),
    ("Foot", -0.90, -0.12),
)


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
        # The arrays are copied, since a scene must not change after its tracer exists.
        vertices = np.array(self.vertices, dtype=np.float64, order="C")
        faces = np.array(self.faces, dtype=np.int32, order="C")
        for name, array in (("vertices", vertices), ("faces", faces)):
            if array.ndim != 2 or array.shape[1] != 3:
                raise ValueError(f"{name} of shape {array.shape}, expected (N, 3)")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if not np.isfinite(vertices).all():
            raise ValueError(
                f"vertices of {self.object_name!r}: expected finite numbers"
            )
        if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
            raise ValueError(
                f"faces have vertex numbers from {faces.min()} to {faces.max()},"
                f" expected 0 to {len(vertices) - 1}"
            )

    def __repr__(self) -> str:
        name, count = self.object_name, len(self.faces)
        return f"<Part {name}: {self.material.name}, {count} triangles>"

    @cached_property
    def bounds(self) -> Floats:
        """The smallest and largest x, y, z of the faces, (2, 3) m; inf if empty."""
        # Vertices that no face uses are ignored, since some mesh files have unused
        # vertices far from all faces.
        is_used = np.zeros(len(self.vertices), np.bool_)
        for corners in self.faces.T:  # One column at a time halves the memory.
            is_used[corners] = True
        used = self.vertices if is_used.all() else self.vertices[is_used]
        # numpy is a hundred times as fast for single axes as for all three at once.
        lows = [axis.min(initial=np.inf) for axis in used.T]
        return np.array([lows, [axis.max(initial=-np.inf) for axis in used.T]])

    @cached_property
    def closed(self) -> bool:
        """Whether the surfaces enclose a volume, so that inside and outside exist."""
        from radarsim.scene.topology import is_closed  # noqa: PLC0415 - rarely needed

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
        safety_distance: The distance between the robot's centre and obstacles in its
            scan that the map is designed for, m.
    """

    start: str
    goal: tuple[float, float]
    safety_distance: float


@dataclass(frozen=True, slots=True)
class Tag:
    """An RFID tag.

    Attributes:
        id: Number of the tag.
        position: x, y, z, m, map frame.
    """

    id: int
    position: Place


@dataclass(frozen=True, slots=True)
class Victim:
    """A person on the floor, whom the victim sensors of rescue robots detect.

    A victim is not an obstacle, and scanners and cameras do not see it. To make a
    victim visible, add an object at its position.

    Attributes:
        name: Name in the map.
        position: x, y, z of the pelvis, m, map frame.
        yaw: Direction from the feet to the head, rad, map frame.
        moves: Whether motion sensors detect the victim.
        loudness: Loudness of its calls at a distance of 1 m, dB; None if silent.
        duration: Duration of each call, s.
        co2: Share of carbon dioxide in its breath, %; 0 if it does not breathe.
    """

    name: str
    position: Place
    yaw: float = 0.0
    moves: bool = False
    loudness: float | None = None
    duration: float = 1.0
    co2: float = 0.0

    @property
    def head(self) -> Place:
        """The position of the victim's head, m, map frame."""
        return self.parts[0][1]

    @property
    def parts(self) -> list[tuple[str, Place]]:
        """Name and position of each part of the victim's body, m, map frame."""
        x, y, z = self.position
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return [
            (part, (x + along * c - left * s, y + along * s + left * c, z))
            for part, along, left in BODY_PARTS
        ]


@dataclass(frozen=True, slots=True)
class Crate:
    """An upright box that clients may move.

    A crate exists only in a simulation, not among the parts of the scene. Like a robot,
    it is an obstacle, and all sensors see it.

    Attributes:
        name: Name of the crate, unique in the map ignoring case.
        size: Length, width and height, m.
        position: x, y, z of the centre, m, map frame.
        yaw: Heading, rad, map frame.
    """

    name: str
    size: Place
    position: Place
    yaw: float = 0.0


@dataclass(frozen=True, slots=True)
class Reflector:
    """A point reflector: a small target whose radar cross section is known.

    The echo power of a target smaller than a beam follows from its radar cross section,
    not from its size. A trihedral, three triangular metal plates at right angles,
    reflects a wave back to its source. Eight trihedrals back to back form the
    octahedral reflector that ships carry. It reflects equally to all sides, so a
    reflector has no orientation.

    A radar that computes power uses the cross section. For range scanners and robots, a
    reflector is an opaque octahedron among the parts of the scene: as large as the
    trihedral, or ``POINT_EDGE`` large for another target.

    Attributes:
        name: Name of the object in the map.
        position: x, y, z, m, map frame.
        trihedral: Leg length of the trihedral's plates, m; None for another target.
        rcs_dbsm: Radar cross section of another target, at every wavelength, dBsm.
    """

    name: str
    position: Place
    trihedral: float | None = None
    rcs_dbsm: float | None = None

    def rcs(self, wavelength: float) -> float:
        """Return the radar cross section, m^2, at a wavelength, m.

        For a trihedral, this is the textbook formula for waves along the axis of
        symmetry, in the far field, for plates much larger than the wavelength.

        >>> trihedral = Reflector("corner", (0.0, 0.0, 0.0), trihedral=0.1)
        >>> round(10 * math.log10(trihedral.rcs(299792458 / 77e9)), 2)
        14.41
        """
        if self.trihedral is not None:
            return 4 * math.pi * self.trihedral**4 / (3 * wavelength**2)
        return float(10 ** ((self.rcs_dbsm or 0.0) / 10))


@dataclass(frozen=True, eq=False, repr=False)
class Scene:
    """The immutable content of a loaded map: objects, materials, starts and more.

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
        reflectors: The point reflectors, in the order of the map file; their meshes are
            among the parts.
        tags: The RFID tags, in the order of the map file.
        victims: The victims, in the order of the map file; victims are not parts.
        crates: The crates, in the order of the map file; only simulations have them.
    """

    name: str
    level: str
    parts: tuple[Part, ...] = ()
    starts: tuple[StartPose, ...] = ()
    materials: Mapping[str, Material] = field(default_factory=dict)
    air: Material | None = None
    trial: Trial | None = None
    gps_origin: tuple[float, float] = GPS_ORIGIN
    reflectors: tuple[Reflector, ...] = ()
    tags: tuple[Tag, ...] = ()
    victims: tuple[Victim, ...] = ()
    crates: tuple[Crate, ...] = ()

    def __repr__(self) -> str:
        objects = len({part.object_name for part in self.parts})
        return f"<Scene {self.name}: {objects} objects, {len(self.starts)} starts>"

    def _repr_html_(self) -> str:
        """Return the plan of the scene as SVG, for notebooks."""
        return radarsim.as_svg(self.plot())

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the plan of the scene with the names of objects and starts.

        The section is at the height of a P3AT's scanner.

        Args:
            ax: Axes of matplotlib, in m; None creates a new figure with a legend.

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

    def with_material(self, name: str, /, **keys: Any) -> "Scene":
        """Return a copy of this scene with a material changed or added.

        Args:
            name: Name of a material of the scene, whose other keys are kept; of a
                library material; or of a new material.
            **keys: Keys of materials in map files, such as ``density=2.0`` or
                ``based_on="foliage"``.

        Raises:
            MapError: If a key or a value is wrong, or beams can enter the material and
                an object made of it is not closed.
        """
        from radarsim.scene import edits  # noqa: PLC0415 - pydantic is slow

        return edits.with_material(self, name, keys)

    def with_object(self, name: str, /, **keys: Any) -> "Scene":
        """Return a copy of this scene with an object, or several copies of it, added.

        Args:
            name: Name of the object.
            **keys: Keys of objects in map files, such as ``cylinder=[0.5, 2.0]``,
                ``material="foliage"`` and ``position=[1.0, 0.0, 1.0]``, the centre
                in m. Paths of meshes are relative to the current folder.

        Raises:
            MapError: If a key or a value is wrong, or the name is taken.
        """
        from radarsim.scene import edits  # noqa: PLC0415

        return edits.with_object(self, name, keys)

    def without(self, name: str) -> "Scene":
        """Return a copy of this scene without an object, or without all its copies.

        Raises:
            MapError: If there is no such object.
        """
        from radarsim.scene import edits  # noqa: PLC0415

        return edits.without(self, name)

    def to_yaml(self, path: "str | Path") -> None:
        """Write a map file, and its meshes into a folder next to it.

        ``load_map`` reads the same scene from it.

        Args:
            path: The map file; ``NAME_meshes`` is the folder of ``NAME.yaml``.

        Raises:
            OSError: If a file cannot be written.
        """
        from radarsim.scene.map_writer import write_map  # noqa: PLC0415

        write_map(self, Path(path))

    def floor_at(self, x: float, y: float) -> float:
        """Return the floor's height at the nearest start, m; 0 without starts."""
        if not self.starts:
            return 0.0
        return min(
            (start.pose for start in self.starts),
            key=lambda pose: math.hypot(pose.x - x, pose.y - y),
        ).z

    def start(self, name: str) -> StartPose | None:
        """Return the start pose with a name, ignoring case; None if there is none."""
        wanted = name.casefold()
        matches = (start for start in self.starts if start.name.casefold() == wanted)
        return next(matches, None)


def expected_scene(given: object) -> TypeError:
    """Return the error for an argument that is not a Scene."""
    text = f"scene {given!r:.80}, expected a Scene"
    if isinstance(given, str | Path):
        text += f" from radarsim.load_map({str(given)[:80]!r})"
    return TypeError(text)


def bounds_of(parts: Iterable[Part]) -> Floats:
    """Return the smallest and largest x, y, z of parts, (2, 3) m; 0 without faces."""
    boxes = [part.bounds for part in parts if part.faces.size]
    if not boxes:
        return np.zeros((2, 3))
    lows, highs = np.stack(boxes, axis=1)
    return np.stack([lows.min(axis=0), highs.max(axis=0)])
