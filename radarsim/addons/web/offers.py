"""What the page can offer: lists that come from the program's own, so that none is old.

Names are those of the program; labels are for people.
"""

from collections.abc import Iterable, Mapping
from enum import StrEnum
from typing import Any, Final

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
        words = []
        for settings in map(config.scanner_settings, scanners):
            covered = settings.fov_deg + settings.resolution_deg  # with the gap behind
            angle = 360 if covered >= 360 else round(settings.fov_deg)
            words.append(f"{settings.medium} {angle}\N{DEGREE SIGN}")
        yield {"name": name, "label": f"{name}: {' + '.join(words) or 'no scanner'}"}


def _named(choices: type[StrEnum]) -> list[dict[str, str]]:
    return [{"name": each.value, "label": _label(each.value)} for each in choices]


def _settings() -> Iterable[dict[str, Any]]:
    """Yield the settings of scanners that one control each can change."""
    schema = SensorSettings.model_json_schema()["properties"]
    for key in (*SLIDERS, *(key for key in schema if key not in SLIDERS)):
        described = schema[key]
        # One that may be left out is any of a value and of null.
        described = described.get("anyOf", [described])[0]
        kind, choices = described["type"], described.get("enum")
        if key == "medium" or kind == "array":
            continue
        least, most = described.get("minimum"), described.get("maximum")
        step = 1.0 if kind == "integer" and choices is None else None
        slides = kind == "number" and key in SLIDERS
        if slides:
            least, most, step = SLIDERS[key]
        words, _, last = key.rpartition("_")
        unit = "m" if key in _METRES else _UNITS.get(last, "")
        yield {
            "key": key,
            "label": _label(words if last in _UNITS else key),
            "type": kind if choices is None else "choice",
            "min": least,
            "max": most,
            "step": step,
            "unit": unit,
            "choices": choices,
            "slides": slides,
        }


def _label(name: str) -> str:
    """Return a name as words: ``side_offset`` is Side offset."""
    words = name.replace("_", " ")
    return words[:1].upper() + words[1:]
