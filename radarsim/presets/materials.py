"""The library of materials: what vegetation, walls and weather do to beams.

Each material is a file in ``materials/``, whose every number says where it is from.
Where amounts matter, as in smoke, the file has the loss for one gramme in a cubic metre
or the law of rain, and an amount to begin with. All losses are one way. Light is that
of a laser of 905 nm.
"""

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any, Final, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict
from ruamel.yaml import YAML

from radarsim.errors import PresetError
from radarsim.presets.hydrometeors import PowerLaw, rain_attenuation
from radarsim.presets.sensor_settings import BANDS_GHZ
from radarsim.presets.sensors import SourcedValue

Amount: TypeAlias = Literal["g_per_m3", "mm_per_h"]
AMOUNTS: Final[tuple[Amount, ...]] = ("g_per_m3", "mm_per_h")

Key: TypeAlias = Literal[
    "density",
    "laser_density",
    "db_per_m",
    "laser_db_per_m",
    "absorption_db",
    "laser_absorption_db",
    "mirror",
    "solid",
    "g_per_m3",
    "db_per_g",
    "laser_db_per_g",
    "mm_per_h",
    "rain_k",
    "rain_alpha",
    "laser_rain_k",
    "laser_rain_alpha",
]
Losses: TypeAlias = tuple[float, float, float]


class LibraryEntry(BaseModel):
    """A file of the library.

    Attributes:
        about: One sentence or two.
        numbers: By name, those that a map may say too: a ``density`` or the dB lost per
            metre, in each of ``BANDS_GHZ`` for a radar. ``db_per_g`` is what a gramme
            in a cubic metre takes in a metre, dB; ``rain_k`` R^``rain_alpha`` what rain
            of R mm/h takes in a kilometre, dB.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    about: str
    numbers: dict[Key, SourcedValue]

    @property
    def amount(self) -> Amount | None:
        """The name of the amount that it takes; None if it takes none."""
        return next((name for name in AMOUNTS if name in self.numbers), None)


@dataclass(frozen=True, slots=True)
class MaterialProperties:
    """A material of the library at one amount.

    Attributes:
        density: 0, or ``math.inf`` if radar beams end at its surface.
        laser_density: The same for light.
        solid: Whether a robot is stopped by it.
        radar_db: What radar waves lose in each of ``BANDS_GHZ``, dB/m.
        laser_db: What light loses, dB/m.
        absorption_db: What a mirror keeps of a radar wave, dB.
        laser_absorption_db: The same of light.
        radar_mirror: Whether it is a mirror to a radar.
        laser_mirror: Whether it is one to light.
        rain: mm/h of rain in it.
    """

    density: float
    laser_density: float
    solid: bool
    radar_db: Losses
    laser_db: float
    absorption_db: float
    laser_absorption_db: float
    radar_mirror: bool
    laser_mirror: bool
    rain: float


@cache
def library_names() -> tuple[str, ...]:
    """Give the names of all materials of the library, sorted."""
    folder = files("radarsim.presets") / "materials"
    names = (file.name for file in folder.iterdir())
    return tuple(sorted(n.removesuffix(".yaml") for n in names if n.endswith(".yaml")))


def library() -> dict[str, LibraryEntry]:
    """Read the whole library, by name, in alphabetical order."""
    return {name: library_entry(name) for name in library_names()}


@cache
def library_entry(name: str) -> LibraryEntry:
    """Read a material's file.

    Raises:
        PresetError: If there is none of that name.
    """
    if name not in library_names():
        expected = f"expected one of {list(library_names())}"
        raise PresetError(f"material {name[:80]!r}, {expected}")
    file = files("radarsim.presets") / "materials" / f"{name}.yaml"
    yaml = YAML(typ="safe", pure=True)
    return LibraryEntry.model_validate(yaml.load(file.read_text(encoding="utf-8")))


def library_material(
    name: str, *, g_per_m3: float | None = None, mm_per_h: float | None = None
) -> MaterialProperties:
    """Take a material from the library.

    Args:
        name: One of ``library_names()``.
        g_per_m3: Of smoke, dust or water in the air; None for the file's own amount.
        mm_per_h: The same of rain.

    Raises:
        PresetError: If there is none of that name, or it takes no such amount.

    >>> library_material("smoke", g_per_m3=1).laser_db
    23.0
    """
    entry = library_entry(name)
    given = {"g_per_m3": g_per_m3, "mm_per_h": mm_per_h}
    for key, amount in given.items():
        if amount is not None and key != entry.amount:
            taken = entry.amount or "no amount"
            raise PresetError(f"material {name!r}: {key} {amount}, expected {taken}")
    values: dict[str, Any] = {key: n.value for key, n in entry.numbers.items()}
    values |= {key: amount for key, amount in given.items() if amount is not None}
    mirror = values.get("mirror", "none")
    radar_db, laser_db = _losses(values)
    return MaterialProperties(
        density=float("inf" if values.get("density") == "opaque" else 0),
        laser_density=float("inf" if values.get("laser_density") == "opaque" else 0),
        solid=values["solid"],
        radar_db=radar_db,
        laser_db=laser_db,
        absorption_db=values.get("absorption_db", 0.0),
        laser_absorption_db=values.get("laser_absorption_db", 0.0),
        radar_mirror=mirror in ("radar", "both"),
        laser_mirror=mirror in ("laser", "both"),
        rain=float(values.get("mm_per_h", 0.0)),
    )


def _losses(values: dict[str, Any]) -> tuple[Losses, float]:
    """Give what radar waves lose in each band, and what light does, dB/m."""
    if "mm_per_h" in values:
        rate = values["mm_per_h"]
        laws = zip(
            _banded(values["rain_k"]), _banded(values["rain_alpha"]), strict=True
        )
        first, second, third = (rain_attenuation(PowerLaw(*law), rate) for law in laws)
        light = PowerLaw(values["laser_rain_k"], values["laser_rain_alpha"])
        return (first, second, third), rain_attenuation(light, rate)
    if "g_per_m3" in values:
        grammes = values["g_per_m3"]
        first, second, third = (grammes * db for db in _banded(values["db_per_g"]))
        return (first, second, third), grammes * values["laser_db_per_g"]
    none = dict.fromkeys(BANDS_GHZ, 0.0)
    light_db = float(values.get("laser_db_per_m", 0.0))
    return _banded(values.get("db_per_m", none)), light_db


def _banded(numbers: dict[int, float]) -> Losses:
    first, second, third = (float(numbers[band]) for band in BANDS_GHZ)
    return first, second, third
