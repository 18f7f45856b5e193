"""What the page can offer: lists that come from the program's own, so that none is old.

Names are those of the program; labels are for people.
"""

import typing
from collections.abc import Iterable, Mapping
from enum import StrEnum
from types import NoneType
from typing import Any, Final, Literal

from annotated_types import Ge, Le
from pydantic.fields import FieldInfo

from radarsim.autonomy.exploration.plans import StrategyName
from radarsim.autonomy.navigation.algorithms import Algorithm
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.simulation.config import SimulationConfig

# What slides, the most useful first: smallest and greatest value, and step. Others take
# any number within the limits of the settings.
SLIDERS: Final[Mapping[str, tuple[float, float, float]]] = {
    "side_offset_uu": (0, 100, 1),
    "penetration_power": (0, 5, 0.05),
    "max_range": (1, 80, 1),
    "ray_choice": (0, 0, 0),  # choices have no limits, but a place in the order
    "return_mode": (0, 0, 0),
}
FIRST_CLASS: Final = "P3AT_Compare360"  # a radar and a laser that see all around
_UNITS: Final = {
    "deg": "°",
    "uu": "UU",
    "hz": "Hz",
    "ghz": "GHz",
    "db": "dB",
    "dbsm": "dBsm",
}
_METRES: Final = (
    "divergence_distance",
    "max_range",
    "min_range",
    "range_noise",
    "range_quantum",
    "range_resolution",
)
_TYPES: Final = {float: "number", int: "integer", bool: "boolean"}


def make_offers(config: SimulationConfig) -> dict[str, Any]:
    """Return the lists of classes, algorithms, strategies and settings.

    Args:
        config: The classes of the server, and how their items differ from their
            presets.
    """
    return {
        "classes": list(_classes(config)),
        "algorithms": _named(Algorithm),
        "strategies": _named(StrategyName),
        "settings": list(_settings()),
    }


def _classes(config: SimulationConfig) -> Iterable[dict[str, str]]:
    """Yield the robot classes, with what their scanners see."""
    for name in sorted(config.robot_names(), key=lambda name: name != FIRST_CLASS):
        scanners = config.robot(name).items_of("RangeScanner")
        words = [_scanner_words(config.scanner_settings(item)) for item in scanners]
        yield {"name": name, "label": f"{name}: {' + '.join(words) or 'no scanner'}"}


def _scanner_words(settings: SensorSettings) -> str:
    covered = settings.fov_deg + settings.resolution_deg  # with the gap behind
    angle = 360 if covered >= 360 else round(settings.fov_deg)
    return f"{settings.medium} {angle}\N{DEGREE SIGN}"


def _named(choices: type[StrEnum]) -> list[dict[str, str]]:
    return [{"name": each.value, "label": _label(each.value)} for each in choices]


def _settings() -> Iterable[dict[str, Any]]:
    """Yield the settings of scanners that one control each can change."""
    fields = SensorSettings.model_fields
    for key in (*SLIDERS, *(key for key in fields if key not in SLIDERS)):
        if key != "medium" and (setting := _setting(key, fields[key])) is not None:
            yield setting


def _setting(key: str, field: FieldInfo) -> dict[str, Any] | None:
    """Describe a setting; return None for one that is a list."""
    kind, choices, limits = _read_type(field)
    if kind is None:
        return None
    least, most = limits.get("ge"), limits.get("le")
    step = 1.0 if kind == "integer" else None
    if kind == "number" and key in SLIDERS:
        least, most, step = SLIDERS[key]
    words, unit = _words_and_unit(key)
    return {
        "key": key,
        "label": _label(words),
        "type": kind,
        "min": least,
        "max": most,
        "step": step,
        "unit": unit,
        "choices": choices,
        "slides": kind == "number" and key in SLIDERS,
    }


def _read_type(
    field: FieldInfo,
) -> tuple[str | None, list[Any] | None, dict[str, float]]:
    """Return the type of a field in words, its choices, and its limits."""
    limits: dict[str, float] = {}
    for mark in field.metadata:
        limits |= _limit(mark)
    annotation = field.annotation
    union = [each for each in typing.get_args(annotation) if each is not NoneType]
    if NoneType in typing.get_args(annotation) and len(union) == 1:
        annotation = union[0]
    if typing.get_origin(annotation) is typing.Annotated:
        annotation, *marks = typing.get_args(annotation)
        for mark in marks:
            for each in getattr(mark, "metadata", [mark]):
                limits |= _limit(each)
    if typing.get_origin(annotation) is Literal:
        return "choice", list(typing.get_args(annotation)), limits
    return (
        _TYPES.get(annotation) if isinstance(annotation, type) else None,
        None,
        limits,
    )


def _limit(mark: object) -> dict[str, float]:
    if isinstance(mark, Ge) and isinstance(mark.ge, int | float):
        return {"ge": mark.ge}
    if isinstance(mark, Le) and isinstance(mark.le, int | float):
        return {"le": mark.le}
    return {}


def _words_and_unit(key: str) -> tuple[str, str]:
    words, _, last = key.rpartition("_")
    if key in _METRES:
        return key, "m"
    return (words, _UNITS[last]) if last in _UNITS else (key, "")


def _label(name: str) -> str:
    """Return a name as words: ``side_offset`` is Side offset."""
    words = name.replace("_", " ")
    return words[:1].upper() + words[1:]
