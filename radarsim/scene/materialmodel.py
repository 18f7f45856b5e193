"""What a map file may say of a material."""

import math
from typing import Annotated, Literal, TypeAlias

from annotated_types import Ge, Le
from pydantic import AfterValidator, PlainValidator, Strict

from radarsim.presets.bands import BANDS_GHZ
from radarsim.presets.materials import library_names
from radarsim.scene.mapmodel import Entry, Real, Text
from radarsim.scene.material import OPAQUE
from radarsim.yamlfile import shown

MAX_DB = 1e6  # in a metre; what takes more is opaque
MAX_AMOUNT = 1000.0  # mm/h, g/m^3

Bands: TypeAlias = tuple[float, float, float]
_BAND_KEYS = [str(band) for band in BANDS_GHZ]


def _density(value: object) -> float:
    number = OPAQUE if value == "opaque" else _number(value)
    if number is None:
        raise ValueError(f"{shown(value)}, expected 'opaque' or a number, at least 0")
    return number


def _absorption(value: object) -> float:
    number = math.inf if value == "all" else _number(value, MAX_DB)
    if number is None:
        expected = f"expected 'all' or a number from 0 to {MAX_DB:g}"
        raise ValueError(f"{shown(value)}, {expected}")
    return number


def _bands(value: object) -> Bands:
    """Take a number for all bands, or one for each."""
    given = value if isinstance(value, dict) else dict.fromkeys(_BAND_KEYS, value)
    first, second, third = (_number(given.get(key), MAX_DB) for key in _BAND_KEYS)
    if first is None or second is None or third is None or len(given) > 3:
        expected = f"expected a number from 0 to {MAX_DB:g}, or one for each of"
        raise ValueError(f"{shown(value)}, {expected} {', '.join(_BAND_KEYS)}")
    return first, second, third


def _number(value: object, most: float = math.inf) -> float | None:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return None
    return float(value) if 0 <= value <= most else None


def _in_library(value: str) -> str:
    if value not in library_names():
        raise ValueError(f"{shown(value)}, expected one of {list(library_names())}")
    return value


Density: TypeAlias = Annotated[float, PlainValidator(_density)]
Decibels: TypeAlias = Annotated[Real, Ge(0), Le(MAX_DB)]
BandDecibels: TypeAlias = Annotated[Bands, PlainValidator(_bands)]
Absorption: TypeAlias = Annotated[float, PlainValidator(_absorption)]
Amount: TypeAlias = Annotated[Real, Ge(0), Le(MAX_AMOUNT)]
LibraryName: TypeAlias = Annotated[Text, AfterValidator(_in_library)]


class MaterialEntry(Entry):
    """A material; what it does not say is as in the one that it is based on.

    Attributes:
        based_on: A material of the library.
        density: Power lost per metre inside; does not count beside a ``sheet_loss``.
        laser_density: The same for a laser beam.
        db_per_m: What radar waves lose inside, one way, in each band.
        laser_db_per_m: The same for light.
        sheet_loss: Power that a radar beam loses at each surface, and nowhere else.
        absorption_db: What an opaque surface keeps of a radar wave.
        laser_absorption_db: The same of light.
        mirror: What an opaque surface reflects like a mirror.
        g_per_m3: Of what the library's material has so much of.
        mm_per_h: The same of rain.
    """

    based_on: LibraryName | None = None
    density: Density | None = None
    laser_density: Density | None = None
    db_per_m: BandDecibels | None = None
    laser_db_per_m: Decibels | None = None
    solid: Annotated[bool, Strict()] | None = None
    sheet_loss: Annotated[Real, Ge(0)] | None = None
    absorption_db: Absorption | None = None
    laser_absorption_db: Absorption | None = None
    mirror: Literal["radar", "laser", "both", "none"] | None = None
    g_per_m3: Amount | None = None
    mm_per_h: Amount | None = None
