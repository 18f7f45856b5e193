"""The material library: how vegetation, walls and weather attenuate beams.

Each material is a file in ``materials/``, whose every number states its source. Where
amounts matter, as in smoke, the file has the loss for one gramme in a cubic metre or
the power law of rain, and a default amount. All losses are one-way. Light means that of
a laser of 905 nm.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, Final, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict

from radarsim.errors import PresetError
from radarsim.presets.preset_files import (
    SourcedValue,
    preset_names,
    read_preset,
    unknown_preset,
)
from radarsim.presets.sensor_settings import BANDS_GHZ

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
    "backscatter_db",
    "albedo",
    "specular_db",
    "slope_deg",
    "transmission_db",
]
Losses: TypeAlias = tuple[float, float, float]
BACKSCATTER_DB: Final = -10.0  # dB, of a rough surface of which nothing is known
ALBEDO: Final = 0.2  # of foliage
SLOPE_DEG: Final = 2.0  # of facets of which only the reflection is known


class LibraryEntry(BaseModel):
    """A file of the library.

    Attributes:
        about: Description in one or two sentences.
        numbers: Values by name; a map may set the same names. ``density`` is a word or
            0; ``db_per_m`` is the loss per metre in each of ``BANDS_GHZ``, dB;
            ``db_per_g`` the loss per metre for one gramme in a cubic metre, dB;
            ``rain_k`` R^``rain_alpha`` the loss in rain of R mm/h, dB/km;
            ``backscatter_db`` what a surface returns to a radar head-on, dB, and
            ``albedo`` the share of a loss that is scattered; ``specular_db`` what
            facets reflect that face a radar, dB, and ``slope_deg`` their rms slope,
            degrees; ``transmission_db`` the loss on the way through a pane, in each
            band, dB.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    about: str
    numbers: dict[Key, SourcedValue]

    @property
    def amount(self) -> Amount | None:
        """The amount that scales its losses; None for a material without one."""
        return next((name for name in AMOUNTS if name in self.numbers), None)


@dataclass(frozen=True, slots=True)
class MaterialProperties:
    """The properties of a library material at one amount.

    Attributes:
        density: 0, or ``math.inf`` if radar beams end at its surface.
        laser_density: 0, or ``math.inf`` if light ends at its surface.
        solid: Whether it stops robots.
        radar_db: Loss of radar waves in each of ``BANDS_GHZ``, dB/m.
        laser_db: Loss of light, dB/m.
        absorption_db: Loss of a radar wave at each reflection by a mirror, dB.
        laser_absorption_db: Loss of light at each reflection by a mirror, dB.
        radar_mirror: Whether it reflects radar waves like a mirror.
        laser_mirror: Whether it reflects light like a mirror.
        rain: Rate of the rain in it, mm/h.
        backscatter_db: What its surface returns to a radar head-on, dB.
        albedo: Share of what it takes from a radar wave that it scatters.
        specular_db: What facets of its surface reflect to a radar that they face, dB;
            None for a rough surface.
        slope_deg: Rms slope of these facets, degrees.
        transmission_db: Loss of radar waves on their way through a pane in each of
            ``BANDS_GHZ``, dB; None for what is none.
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
    backscatter_db: float
    albedo: float
    specular_db: float | None
    slope_deg: float
    transmission_db: Losses | None


def library_names() -> tuple[str, ...]:
    """Return the names of all materials of the library, sorted."""
    return preset_names("materials")


def library() -> dict[str, LibraryEntry]:
    """Read the whole library, by name, in alphabetical order."""
    return {name: library_entry(name) for name in library_names()}


@cache
def library_entry(name: str) -> LibraryEntry:
    """Read the file of a material.

    Raises:
        PresetError: If there is no such material.
    """
    if name not in library_names():
        raise unknown_preset("material", name, library_names())
    return LibraryEntry.model_validate(read_preset("materials", name))


def library_material(
    name: str, *, g_per_m3: float | None = None, mm_per_h: float | None = None
) -> MaterialProperties:
    """Return the properties of a library material.

    Args:
        name: One of ``library_names()``.
        g_per_m3: Mass of smoke, dust or water in a cubic metre of air; None for the
            default of the file.
        mm_per_h: Rate of rain; None for the default of the file.

    Raises:
        PresetError: If there is no such material, or an amount does not apply to it.

    >>> library_material("smoke", g_per_m3=1).laser_db
    23.0
    """
    entry = library_entry(name)
    amounts = {"g_per_m3": g_per_m3, "mm_per_h": mm_per_h}
    amounts = {key: amount for key, amount in amounts.items() if amount is not None}
    for key, amount in amounts.items():
        if key != entry.amount:
            expected = entry.amount or "no amount"
            raise PresetError(f"material {name!r}: {key} {amount}, expected {expected}")
    values: dict[str, Any] = {key: n.value for key, n in entry.numbers.items()}
    values |= amounts
    mirror = values.get("mirror", "none")
    radar_db, laser_db = _losses(values)
    transmission = values.get("transmission_db")
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
        backscatter_db=float(values.get("backscatter_db", BACKSCATTER_DB)),
        albedo=float(values.get("albedo", ALBEDO)),
        specular_db=values.get("specular_db"),
        slope_deg=float(values.get("slope_deg", SLOPE_DEG)),
        transmission_db=None if transmission is None else _by_band(transmission),
    )


def _losses(values: dict[str, Any]) -> tuple[Losses, float]:
    """Return the loss of radar waves in each band, and that of light, dB/m."""
    if "mm_per_h" in values:
        rate = values["mm_per_h"]
        laws = zip(
            _by_band(values["rain_k"]), _by_band(values["rain_alpha"]), strict=True
        )
        first, second, third = (rain_attenuation(k, alpha, rate) for k, alpha in laws)
        light = rain_attenuation(
            values["laser_rain_k"], values["laser_rain_alpha"], rate
        )
        return (first, second, third), light
    if "g_per_m3" in values:
        grammes = values["g_per_m3"]
        first, second, third = (grammes * db for db in _by_band(values["db_per_g"]))
        return (first, second, third), grammes * values["laser_db_per_g"]
    none = dict.fromkeys(map(str, BANDS_GHZ), 0.0)
    light = float(values.get("laser_db_per_m", 0.0))
    return _by_band(values.get("db_per_m", none)), light


def _by_band(numbers: dict[str, float]) -> Losses:
    first, second, third = (float(numbers[str(band)]) for band in BANDS_GHZ)
    return first, second, third


def rain_attenuation(k: float, alpha: float, mm_per_h: float) -> float:
    """Return the one-way loss in rain by the power law k R^alpha of ITU-R P.838, dB/m.

    Args:
        k: Loss at 1 mm/h, dB/km.
        alpha: Exponent of the rain rate.
        mm_per_h: R, rate of the rain.

    >>> round(1000 * rain_attenuation(0.22106804, 0.95320005, 26.48052), 6)  # 29 GHz
    5.021802
    """
    return float(k * mm_per_h**alpha / 1000)
