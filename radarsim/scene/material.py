"""Materials: how they attenuate and reflect beams, and whether they stop robots.

The library describes vegetation, walls and weather. Each of its materials is a file in
``presets/materials/``, in which every number states its source. The file of a material
with a variable amount, such as smoke or rain, has the loss per g/m^3 or the power law
of rain, and a default amount. All losses are one-way. Light means laser light at
905 nm.
"""

import math
from dataclasses import dataclass, fields
from functools import cache
from typing import Annotated, Any, Final, Literal, TypeAlias

import numpy as np
from annotated_types import Ge, Le
from pydantic import BaseModel, PlainValidator, Strict, TypeAdapter

from radarsim.errors import PresetError, expected_one_of
from radarsim.presets import SourcedValue, preset_names, read_preset
from radarsim.presets.sensor_settings import BANDS_GHZ
from radarsim.validation import short_repr

OPAQUE: Final = math.inf
ALBEDO: Final = 0.2  # albedo of foliage, the default
BACKSCATTER_DB: Final = -10.0  # default for rough surfaces without a known value
SLOPE_DEG: Final = 2.0  # rms, of facets, if only their reflection is known

MAX_DB: Final = 1e6  # per metre; a material that attenuates more is opaque
MAX_LEVEL: Final = 200.0  # dB; largest absolute value of a level, such as backscatter
_BAND_KEYS: Final = [str(band) for band in BANDS_GHZ]

Losses: TypeAlias = tuple[float, float, float]  # one loss per band of ``BANDS_GHZ``
Amount: TypeAlias = Literal["g_per_m3", "mm_per_h"]
AMOUNTS: Final[tuple[Amount, ...]] = ("g_per_m3", "mm_per_h")

# Radar cross section of rain per volume, dB(m^2/m^3), in each band, at these rain
# rates. The values were computed for this project at 24, 77 and 94 GHz with Mie theory
# and the Marshall-Palmer distribution of drop sizes.
RAIN_RATES: Final = (1.0, 5.0, 12.5, 25.0, 50.0, 100.0)  # mm/h
RAIN_REFLECTIVITY_DB: Final = (
    (-53.4, -43.0, -37.5, -33.7, -30.2, -27.0),
    (-39.3, -33.6, -30.9, -29.0, -27.2, -25.5),
    (-38.8, -33.7, -31.2, -29.5, -27.8, -26.2),
)


def _absorption(value: object) -> float:
    number = math.inf if value == "all" else number_up_to(value, MAX_DB)
    if number is None:
        expected = f"expected 'all' or a number from 0 to {MAX_DB:g}"
        raise ValueError(f"{short_repr(value)}, {expected}")
    return number


def _bands(value: object) -> Losses:
    """Parse one number for all radar bands, or a dictionary with a number per band."""
    given = value if isinstance(value, dict) else dict.fromkeys(_BAND_KEYS, value)
    first, second, third = (number_up_to(given.get(key), MAX_DB) for key in _BAND_KEYS)
    if first is None or second is None or third is None or len(given) > 3:
        expected = f"expected a number from 0 to {MAX_DB:g}, or one for each of"
        raise ValueError(f"{short_repr(value)}, {expected} {', '.join(_BAND_KEYS)}")
    return first, second, third


def number_up_to(value: object, most: float = math.inf) -> float | None:
    """Return a number from 0 to ``most`` as a float; None for any other value."""
    # In Python a bool is an int, so true would be accepted as 1.
    if not isinstance(value, int | float) or isinstance(value, bool):
        return None
    return float(value) if 0 <= value <= most else None


Real: TypeAlias = Annotated[float, Strict()]
Truth: TypeAlias = Annotated[bool, Strict()]
Level: TypeAlias = Annotated[Real, Ge(-MAX_LEVEL), Le(MAX_LEVEL)]
BandDecibels: TypeAlias = Annotated[Losses, PlainValidator(_bands)]
Absorption: TypeAlias = Annotated[float, PlainValidator(_absorption)]


@dataclass(frozen=True, slots=True, repr=False)
class Material:
    """A named material.

    All attributes in `PLAIN_KEYS` are also keys of maps and of library files.

    Attributes:
        name: Name, as the map file spells it.
        density: Penetration power that a radar beam loses per metre inside;
            ``math.inf`` is opaque: the beam ends at the surface.
        laser_density: Penetration power that a laser beam loses per metre inside.
        solid: Whether the material stops robots.
        sheet_loss: Power that a radar beam loses at each surface crossed, for objects
            without an inside, such as single leaves; None for volumes and opaque
            surfaces. With a sheet loss only surfaces attenuate, even closed ones: a
            finite density is ignored, and a laser beam loses nothing inside if
            ``laser_density`` is finite.
        radar_db: (3,) one-way attenuation of radar waves inside, dB/m, in each of
            ``BANDS_GHZ``. It adds to the density; the sensor's margin converts it to
            power.
        laser_db: One-way attenuation of light inside, dB/m.
        absorption_db: Part of a radar wave that an opaque surface absorbs, dB; a beam
            with a smaller margin does not return. ``math.inf`` absorbs everything.
        laser_absorption_db: Part of a light beam that an opaque surface absorbs, dB.
        radar_mirror: Whether an opaque surface is a mirror to radar waves.
        laser_mirror: Whether an opaque surface is a mirror to light.
        rain: Rain rate inside, mm/h; a radar sees the drops.
        transmission_db: (3,) one-way loss of a radar wave through a pane with mirror
            surfaces, dB, in each of ``BANDS_GHZ``; each surface takes half of it. None
            if the material lets no wave through.
        attenuation_db: (3,) one-way attenuation of radar waves inside, dB/m, in each of
            ``BANDS_GHZ``. A radar that computes in decibels uses it instead of
            ``density`` and ``radar_db``; None if it uses these two.
        sheet_attenuation_db: (3,) one-way attenuation by each surface crossed, dB. A
            radar that computes in decibels uses it instead of ``sheet_loss``.
        backscatter_db: Backscatter of an opaque surface at normal incidence: radar
            cross section per area seen, gamma 0, dB, after subtraction of the
            absorption.
        constant_gamma: Whether an opaque surface has the same gamma at all angles, as
            open ground has; otherwise gamma follows Lambert's law. In a spectrum, such
            ground continues beyond the edge of the map.
        roughness_cm3: Spectral density of the height of the ground, cm^3, at a spatial
            frequency of 0.1 cycles per metre, as in ISO 8608; 0 for even ground.
        specular_db: Power reflection of the facets of an opaque surface at normal
            incidence, dB; 0 reflects all. None for a surface without facets.
        slope_deg: Rms slope of these facets against the surface, degrees.
        albedo: Scattered share of the radar power that a volume or a sheet takes from
            a wave; the rest is absorbed. The echoes of ``rain`` drops are added.
        sway_m_per_s: Rms speed at which the wind moves the scatterers of a volume or a
            sheet along a radar wave, m/s; it affects only the speckle of a spectrum.
        scatters_light: Whether a volume scatters laser light back from every depth;
            None if unknown. It is true for smoke, dust and fog in the library.
    """

    name: str
    density: float = OPAQUE
    laser_density: float = OPAQUE
    solid: Truth = True
    sheet_loss: float | None = None
    radar_db: Losses = (0.0, 0.0, 0.0)
    laser_db: float = 0.0
    absorption_db: Absorption = 0.0
    laser_absorption_db: Absorption = 0.0
    radar_mirror: bool = False
    laser_mirror: bool = False
    rain: float = 0.0
    attenuation_db: BandDecibels | None = None
    sheet_attenuation_db: BandDecibels | None = None
    backscatter_db: Level = BACKSCATTER_DB
    albedo: Annotated[Real, Ge(0), Le(1)] = ALBEDO
    sway_m_per_s: Annotated[Real, Ge(0), Le(10)] = 0.0
    constant_gamma: Truth = False
    roughness_cm3: Annotated[Real, Ge(0), Le(100_000)] = 0.0
    specular_db: Annotated[Real, Ge(-MAX_LEVEL), Le(0)] | None = None
    slope_deg: Annotated[Real, Ge(0.2), Le(30)] = SLOPE_DEG
    transmission_db: BandDecibels | None = None
    scatters_light: Truth | None = None

    def __repr__(self) -> str:
        """Return the constructor call, without arguments that have their defaults."""
        others = [
            f"{field.name}={getattr(self, field.name)!r}"
            for field in fields(self)[1:]
            if getattr(self, field.name) != field.default
        ]
        return f"Material({', '.join([repr(self.name), *others])})"

    @property
    def penetrable(self) -> bool:
        """Whether radar or laser beams can enter volumes of this material."""
        return math.isfinite(self.density) or math.isfinite(self.laser_density)

    @property
    def lets_beams_in(self) -> bool:
        """Whether radar or laser beams can enter or pass objects of this material."""
        return self.penetrable or self.sheet_loss is not None

    @property
    def is_cloud(self) -> bool:
        """Whether a laser can receive first returns from inside, as in smoke.

        If ``scatters_light`` is None, a material counts as a cloud unless it is rain or
        stops robots, as glass and plants do.
        """
        scatters = self.scatters_light
        if scatters is None:
            scatters = not self.solid and not self.rain
        lost = self.laser_density + self.laser_db
        return scatters and self.sheet_loss is None and 0 < lost < OPAQUE


_MATERIAL: Final = TypeAdapter(Material)
# Attributes that are computed from other keys of maps: ``db_per_m``, ``mirror``, ...
_DERIVED: Final = {
    *("name", "density", "laser_density", "sheet_loss", "radar_db", "laser_db"),
    *("radar_mirror", "laser_mirror", "rain"),
}
PLAIN_KEYS: Final = tuple(
    field.name for field in fields(Material) if field.name not in _DERIVED
)


class LibraryEntry(BaseModel, extra="forbid", frozen=True):
    """A material of the library, as its file describes it.

    Attributes:
        about: Description in one or two sentences.
        numbers: Values by name; a map may set the same names. ``density`` is "opaque"
            or 0; ``db_per_m`` is the loss per metre in each of ``BANDS_GHZ``, dB;
            ``db_per_g`` is the loss per metre at 1 g/m^3, dB;
            ``rain_k`` R^``rain_alpha`` is the loss in rain of R mm/h, dB/km; names with
            ``laser_`` are the same for light. Other names are attributes of `Material`,
            or ``mirror``.
    """

    about: str
    numbers: dict[str, SourcedValue]

    @property
    def amount(self) -> Amount | None:
        """The key that scales the material's losses, such as ``mm_per_h``, or None."""
        return next((name for name in AMOUNTS if name in self.numbers), None)


def library_names() -> tuple[str, ...]:
    """Return the names of all materials of the library, sorted."""
    return preset_names("materials")


def library() -> dict[str, LibraryEntry]:
    """Return all entries of the library by name, in alphabetical order."""
    return {name: library_entry(name) for name in library_names()}


@cache
def library_entry(name: str) -> LibraryEntry:
    """Read the library file of a material.

    Raises:
        PresetError: If there is no such material.
    """
    if name not in library_names():
        raise PresetError(f"material {expected_one_of(name, library_names())}")
    return LibraryEntry.model_validate(read_preset("materials", name))


def library_material(
    name: str, *, g_per_m3: float | None = None, mm_per_h: float | None = None
) -> Material:
    """Return a material of the library.

    Args:
        name: One of ``library_names()``.
        g_per_m3: Mass of smoke, dust or water in a cubic metre of air; None for the
            default of the file.
        mm_per_h: Rate of rain; None for the default of the file.

    Raises:
        PresetError: If the material does not exist, or has no such amount.

    >>> library_material("smoke", g_per_m3=1).laser_db
    23.0
    """
    entry = library_entry(name)
    values: dict[str, Any] = {key: n.value for key, n in entry.numbers.items()}
    for key, amount in (("g_per_m3", g_per_m3), ("mm_per_h", mm_per_h)):
        if amount is None:
            continue
        if key != entry.amount:
            expected = entry.amount or "no amount"
            raise PresetError(f"material {name!r}: {key} {amount}, expected {expected}")
        values[key] = amount
    radar_db = _bands(values.get("db_per_m", 0.0))
    laser_db = float(values.get("laser_db_per_m", 0.0))
    if entry.amount == "mm_per_h":
        rate = values["mm_per_h"]
        laws = zip(_bands(values["rain_k"]), _bands(values["rain_alpha"]), strict=True)
        first, second, third = (rain_attenuation(k, alpha, rate) for k, alpha in laws)
        radar_db = first, second, third
        laser_db = rain_attenuation(
            values["laser_rain_k"], values["laser_rain_alpha"], rate
        )
    elif entry.amount == "g_per_m3":
        grammes = values["g_per_m3"]
        first, second, third = (grammes * db for db in _bands(values["db_per_g"]))
        radar_db = first, second, third
        laser_db = grammes * values["laser_db_per_g"]
    mirror = values.get("mirror", "none")
    return _MATERIAL.validate_python(
        {
            "name": name,
            "density": OPAQUE if values.get("density") == "opaque" else 0.0,
            "laser_density": OPAQUE if values.get("laser_density") == "opaque" else 0.0,
            "radar_db": radar_db,
            "laser_db": laser_db,
            "radar_mirror": mirror in ("radar", "both"),
            "laser_mirror": mirror in ("laser", "both"),
            "rain": values.get("mm_per_h", 0.0),
            "scatters_light": entry.amount == "g_per_m3",
            **{key: values[key] for key in PLAIN_KEYS if key in values},
        }
    )


def rain_attenuation(k: float, alpha: float, mm_per_h: float) -> float:
    """Return the one-way loss in rain by the power law k R^alpha of ITU-R P.838, dB/m.

    Args:
        k: Loss at 1 mm/h, dB/km.
        alpha: Exponent of the rain rate.
        mm_per_h: Rain rate R.

    >>> round(1000 * rain_attenuation(0.22106804, 0.95320005, 26.48052), 6)  # 29 GHz
    5.021802
    """
    return float(k * mm_per_h**alpha / 1000)


def rain_reflectivity(band: int, mm_per_h: float) -> float:
    """Return the radar cross section of a cubic metre of rain, m^2/m^3.

    Between the tabulated rates, a power law is interpolated.

    Args:
        band: Index into ``BANDS_GHZ``.
        mm_per_h: Rain rate; outside 1 to 100 mm/h the power law is extrapolated.

    >>> round(rain_reflectivity(1, 25), 5)
    0.00126
    """
    if mm_per_h <= 0:
        return 0.0
    rates, decibels = np.log10(RAIN_RATES), np.array(RAIN_REFLECTIVITY_DB[band])
    rate = np.log10(mm_per_h)
    i = int(np.clip(np.searchsorted(rates, rate) - 1, 0, len(rates) - 2))
    slope = (decibels[i + 1] - decibels[i]) / (rates[i + 1] - rates[i])
    return float(10 ** ((decibels[i] + slope * (rate - rates[i])) / 10))
