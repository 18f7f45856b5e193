"""The schema of map files: one pydantic model for each type of entry.

The models validate one key at a time. Checks of several keys are in `map_checks`;
`map_loader` checks that names are unique.
"""

import math
import re
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import (
    Annotated,
    Any,
    ClassVar,
    Final,
    Literal,
    TypeAlias,
    TypedDict,
    cast,
    get_type_hints,
)

from annotated_types import Ge, Gt, Le, Len, MaxLen
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PlainValidator,
    Strict,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)

from radarsim.errors import did_you_mean, expected_one_of, list_names
from radarsim.geometry import Pose3
from radarsim.scene.material import (
    MAX_DB,
    MAX_LEVEL,
    OPAQUE,
    PLAIN_KEYS,
    BandDecibels,
    Level,
    Material,
    Real,
    Truth,
    library_names,
    number_up_to,
)
from radarsim.scene.mesh_files import MeshError, find_inside
from radarsim.scene.scene import (
    GPS_ORIGIN,
    LARGEST,
    SMALLEST,
    Crate,
    Place,
    StartPose,
    Tag,
    Victim,
)
from radarsim.validation import point_hint, rejection, short_repr

MAX_EXTENT = 1000.0  # m; limits the rounding errors of ray casting in float32
MAX_COPIES = 10_000  # copies per object
MAX_OBJECTS = 20_000  # objects per scene, including copies
MAX_BUILT = 60_000  # objects built for the map and all its variants, including copies
MAX_PARTS = 30_000  # parts per scene; an object has one part per material
MAX_MATERIALS = 1_000
MAX_STARTS = 200
MAX_VICTIMS = 100
MAX_TAGS = 1_000
MAX_VARIANTS = 100
MAX_ENTRIES = 100_000  # objects in a file, counted again for each variant
MAX_NAME = 200  # characters in the name of an object or a level
MAX_START_NAME = 40  # characters, so that one line on the wire can list many starts
MAX_AMOUNT = 1000.0  # mm/h, g/m^3
MAX_TAG = 2**31 - 1  # clients read tag numbers into 32-bit integers
MAX_DURATION = 3600.0  # s; longest call of a victim

LEVEL_NAME = rf"[!-z|~]{{1,{MAX_NAME}}}"  # one word of a line on the wire
START_NAME = r"(Robot|Player|ComSt|Point)[A-Za-z]*[0-9]*(_[0-9])?"


class EntryContext(TypedDict):
    """The context that pydantic passes to the validators of an object.

    Attributes:
        materials: The names of the map's own materials.
        folder: The map's own folder, links resolved.
    """

    materials: Collection[str]
    folder: Path


def _name(value: str) -> str:
    if not value.strip() or not value.isprintable() or re.search(r"[{}]", value):
        raise ValueError(f"{short_repr(value)}, expected printable text without braces")
    return value


def _matching(pattern: str, expected: str) -> AfterValidator:
    """Return a validator of text that must match a regular expression completely."""

    def check(value: str) -> str:
        if not re.fullmatch(pattern, value):
            raise ValueError(f"{short_repr(value)}, expected {expected}")
        return value

    return AfterValidator(check)


def level_of(stem: str) -> str:
    """Return a level name from a file's stem; "_" replaces other characters."""
    return re.sub("[^A-Za-z0-9-]", "_", stem)[: MAX_NAME - len("DM-")]


def _ordered(value: list[list[float]]) -> list[list[float]]:
    for low, high in zip(*value, strict=True):
        if low > high:
            raise ValueError(f"{short_repr(value)}, expected the lower corner first")
    return value


def _known_material(value: str, info: ValidationInfo) -> str:
    context = cast("EntryContext", info.context)
    own = context["materials"]
    if value not in own and value not in library_names():
        # The search for similar names is slow, so it runs only if the message is
        # reported.
        raise rejection(lambda: unknown_material(value, own))
    return value


def unknown_material(value: str, own: Iterable[str]) -> str:
    """Return the message for a material that neither the map nor the library has."""
    names = sorted(own)
    meant = did_you_mean(value, (*library_names(), *names))
    of_map = f"one of {list_names(names)}, or of" if names else "one of"
    expected = f"expected {of_map} the library, {list(library_names())}"
    return f"{short_repr(value)}{meant}, {expected}"


def _mesh_file(value: str, info: ValidationInfo) -> str:
    context = cast("EntryContext", info.context)
    folder = context["folder"]
    try:
        find_inside(folder, folder, value)
    except MeshError as error:
        raise ValueError(str(error)) from error
    return value


def _density(value: object) -> float:
    number = OPAQUE if value == "opaque" else number_up_to(value)
    if number is None:
        raise ValueError(
            f"{short_repr(value)}, expected 'opaque' or a number, at least 0"
            f"{point_hint(value)}"
        )
    return number


def _in_library(value: str) -> str:
    if value not in library_names():
        raise ValueError(expected_one_of(value, library_names()))
    return value


Coordinate: TypeAlias = Annotated[Real, Ge(-MAX_EXTENT), Le(MAX_EXTENT)]
Size: TypeAlias = Annotated[Real, Gt(0), Le(MAX_EXTENT)]
Vector: TypeAlias = Annotated[list[Coordinate], Len(3, 3)]
Corner: TypeAlias = Annotated[list[Coordinate], Len(2, 2)]
# The poles are excluded, since a degree of longitude has no length there.
GpsOrigin: TypeAlias = tuple[
    Annotated[Real, Ge(-89), Le(89)], Annotated[Real, Ge(-180), Le(180)]
]
Text: TypeAlias = Annotated[str, Strict()]
Whole: TypeAlias = Annotated[int, Strict()]
MaterialName: TypeAlias = Annotated[Text, AfterValidator(_known_material)]
MeshFile: TypeAlias = Annotated[Text, AfterValidator(_mesh_file)]
LevelName: TypeAlias = Annotated[
    Text, MaxLen(MAX_NAME), _matching(LEVEL_NAME, "ASCII without blanks and braces")
]
StartName: TypeAlias = Annotated[
    Text,
    MaxLen(MAX_START_NAME),
    _matching(START_NAME, "Robot, Player, ComSt or Point, then letters, then digits"),
]
VariantName: TypeAlias = Annotated[
    Text, _matching(r"[A-Za-z0-9_-]+", "letters, digits, '_' and '-'")
]
Density: TypeAlias = Annotated[float, PlainValidator(_density)]
Decibels: TypeAlias = Annotated[Real, Ge(0), Le(MAX_DB)]
Amount: TypeAlias = Annotated[Real, Ge(0), Le(MAX_AMOUNT)]
LibraryName: TypeAlias = Annotated[Text, AfterValidator(_in_library)]


class Entry(BaseModel):
    """Base class of all entries of a map file; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Header(Entry):
    """The top level of a map file; its entries are validated one by one.

    Attributes:
        gps_origin_deg: Latitude and longitude of the map frame's origin, degrees.
    """

    version: Literal[1]
    level: LevelName
    materials: dict[Text, object] | None = None
    objects: list[object] | None = None
    starts: list[object] | None = None
    tags: list[object] | None = None
    victims: list[object] | None = None
    crates: list[object] | None = None
    trial: object = None
    air: Text | None = None
    gps_origin_deg: GpsOrigin = GPS_ORIGIN
    variants: dict[VariantName, object] | None = None


class VariantEntry(Entry):
    """The entries of a variant, which add to or replace the entries of its map.

    Attributes:
        materials: Materials that are added, or replace materials of the same names.
        objects: Objects that are added.
        air: Material of the air instead of the map's; None for clear air.
    """

    materials: dict[Text, object] | None = None
    objects: list[object] | None = None
    air: Text | None = None


class MaterialKeys(Entry):
    """The keys of a material that are converted to other attributes of `Material`.

    Attributes:
        based_on: Name of a material of the library.
        density: Power that a radar beam loses per metre inside; ignored with a
            ``sheet_loss``.
        laser_density: Power that a laser beam loses per metre inside.
        db_per_m: One-way attenuation of radar waves inside, dB/m, in each band.
        laser_db_per_m: One-way attenuation of light inside, dB/m.
        sheet_loss: Power that a radar beam loses at each surface, and nowhere else.
        mirror: The beams to which an opaque surface is a mirror.
        g_per_m3: Mass concentration of the library material's particles, g/m³.
        mm_per_h: Rain rate of the library material, mm/h.
    """

    based_on: LibraryName | None = None
    density: Density | None = None
    laser_density: Density | None = None
    db_per_m: BandDecibels | None = None
    laser_db_per_m: Decibels | None = None
    sheet_loss: Annotated[Real, Ge(0)] | None = None
    mirror: Literal["radar", "laser", "both", "none"] | None = None
    g_per_m3: Amount | None = None
    mm_per_h: Amount | None = None


def _plain_keys() -> dict[str, Any]:
    """Return the keys that are attributes of materials, with their types."""
    hints = get_type_hints(Material, include_extras=True)
    return {key: (hints[key] | None, None) for key in PLAIN_KEYS}


# A material; missing keys are taken from the material that it is based on.
MaterialEntry: Final = create_model(
    "MaterialEntry", __base__=MaterialKeys, **_plain_keys()
)


class ReflectorEntry(Entry):
    """A point reflector.

    Attributes:
        trihedral: Length of the legs of a trihedral's plates, m.
        rcs_dbsm: Radar cross section, dBsm.
    """

    trihedral: Size | None = None
    rcs_dbsm: Level | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> "ReflectorEntry":
        if (self.trihedral is None) == (self.rcs_dbsm is None):
            raise ValueError("expected exactly one of 'trihedral' and 'rcs_dbsm'")
        return self


class RepeatEntry(Entry):
    """Copies of an object on a line, each offset by ``step`` from the previous copy."""

    count: Annotated[Whole, Ge(1), Le(MAX_COPIES)]
    step: Vector


class ScatterEntry(Entry):
    """Copies of an object at random positions in a rectangle on the floor.

    Attributes:
        count: Number of copies.
        area: Lower and upper corner of the rectangle, m.
        seed: Seed of positions and sizes.
        min_distance: Smallest distance between any two positions, m.
        scale: Smallest and largest factor of a copy's size.
    """

    count: Annotated[Whole, Ge(1), Le(MAX_COPIES)]
    area: Annotated[list[Corner], Len(2, 2), AfterValidator(_ordered)]
    seed: Annotated[Whole, Ge(0)]
    min_distance: Annotated[Real, Ge(0)] = 0.0
    scale: Annotated[list[Size], Len(2, 2)] = Field(default_factory=lambda: [1.0, 1.0])

    @field_validator("scale")
    @classmethod
    def _ascending(cls, value: list[float]) -> list[float]:
        if value[0] > value[1]:
            raise ValueError(f"{short_repr(value)}, expected the smaller number first")
        return value


class ObjectEntry(Entry):
    """An object with its shape, materials, placement and copies.

    Its validation needs an ``EntryContext``.

    Attributes:
        box: Lengths along x, y, z, m.
        sphere: Radius, m.
        cylinder: Radius and height, m.
        mesh: Path of a mesh file in the map's folder.
        reflector: Point reflector, for which material and rotation are not allowed.
        up_axis: Axis of the mesh file that points up.
        scale: Length of the mesh file's unit, m.
        material: Material of the whole object.
        materials: Material for each material name in the mesh file.
        position: Position of a primitive's centre, or of a mesh's origin, m.
    """

    name: Annotated[Text, MaxLen(MAX_NAME), AfterValidator(_name)]
    box: Annotated[list[Size], Len(3, 3)] | None = None
    sphere: Size | None = None
    cylinder: Annotated[list[Size], Len(2, 2)] | None = None
    mesh: MeshFile | None = None
    reflector: ReflectorEntry | None = None
    up_axis: Literal["y", "z"] = "z"
    scale: Size = 1.0
    material: MaterialName | None = None
    materials: dict[Text, MaterialName] | None = None
    position: Vector = Field(default_factory=lambda: [0.0, 0.0, 0.0])
    yaw_deg: Real = 0.0
    rotation_deg: Annotated[list[Real], Len(3, 3)] | None = None
    repeat: RepeatEntry | None = None
    scatter: ScatterEntry | None = None

    def angles(self) -> tuple[float, float, float]:
        """Return roll, pitch and yaw of the object, rad."""
        degrees = self.rotation_deg or [0.0, 0.0, self.yaw_deg]
        roll, pitch, yaw = (math.radians(angle) for angle in degrees)
        return roll, pitch, yaw

    @property
    def material_names(self) -> list[str]:
        """The names of the object's materials in the map."""
        one = [] if self.material is None else [self.material]
        return [*one, *(self.materials or {}).values()]

    @property
    def copies(self) -> int | None:
        """The number of copies; None if the object is not repeated or scattered."""
        copies = self.repeat or self.scatter
        return copies.count if copies else None


class PlacedEntry(Entry):
    """Base class of entries with a position, such as starts, tags, victims and crates.

    Attributes:
        unique_key: Key whose value is unique in the section, ignoring case.
    """

    unique_key: ClassVar[str] = "name"
    position: Vector

    @property
    def place(self) -> Place:
        """The position of the entry as a tuple x, y, z, in m, map frame."""
        x, y, z = self.position
        return x, y, z

    def build(self) -> object:
        """Return the object that this entry adds to the scene."""
        raise NotImplementedError


class TagEntry(PlacedEntry):
    """The entry of an RFID tag."""

    unique_key: ClassVar[str] = "id"
    id: Annotated[Whole, Ge(0), Le(MAX_TAG)]

    def build(self) -> Tag:
        """Return the RFID tag that this entry describes."""
        return Tag(self.id, self.place)


class NamedEntry(PlacedEntry):
    """A placed entry with a name and a yaw angle."""

    name: Annotated[Text, MaxLen(MAX_NAME), AfterValidator(_name)]
    yaw_deg: Real = 0.0

    @property
    def yaw(self) -> float:
        """The yaw angle of the entry, rad, map frame."""
        return math.radians(self.yaw_deg)


class StartEntry(NamedEntry):
    """A pose on the floor where robots start."""

    name: StartName

    def build(self) -> StartPose:
        """Return the start pose that this entry describes."""
        return StartPose(self.name, Pose3(*self.place, yaw=self.yaw))


class VictimEntry(NamedEntry):
    """A victim, which lies on the floor.

    Attributes:
        position: Position of the pelvis, m.
        yaw_deg: Direction from the feet to the head.
        moves: Whether motion sensors detect the victim.
        sound_db: Loudness of its calls at a distance of 1 m, dB.
        sound_s: Duration of each call, s.
        co2_percent: Share of carbon dioxide in its breath, %.
    """

    moves: Truth = False
    sound_db: Annotated[Real, Ge(0), Le(MAX_LEVEL)] | None = None
    sound_s: Annotated[Real, Gt(0), Le(MAX_DURATION)] = 1.0
    co2_percent: Annotated[Real, Ge(0), Le(100)] = 0.0

    def build(self) -> Victim:
        """Return the victim that this entry describes."""
        signs = self.moves, self.sound_db, self.sound_s, self.co2_percent
        return Victim(self.name, self.place, self.yaw, *signs)


class CrateEntry(NamedEntry):
    """A box that clients may move.

    Attributes:
        size: Length, width and height, m.
        position: Position of the centre, m.
    """

    size: Annotated[list[Annotated[Real, Ge(SMALLEST), Le(LARGEST)]], Len(3, 3)]

    def build(self) -> Crate:
        """Return the crate that this entry describes."""
        length, width, height = self.size
        return Crate(self.name, (length, width, height), self.place, self.yaw)


class TrialEntry(Entry):
    """A navigation task on the map.

    Attributes:
        start: Name of a start, case-insensitive.
        goal: x and y of the goal on the floor, m.
        safety_distance: Safety distance that the map is designed for, m.
    """

    start: Text
    goal: Corner
    safety_distance: Size
