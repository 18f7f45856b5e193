"""Sensor presets: named settings of scanners."""

import functools
import re
from typing import Any, Final

from pydantic import BaseModel, ConfigDict, ValidationError

from radarsim import plugins
from radarsim.errors import PresetError, expected_one_of
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.presets.preset_files import (
    SourcedValue,
    preset_names,
    read_preset,
    unknown_preset,
)
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.validation import describe_invalid, short_repr
from radarsim.yaml_reader import parse_plain

MOST_SETTINGS: Final = len(SensorSettings.model_fields) + 1  # that are parsed at once

_NEXT_SETTING: Final = re.compile(r"[\s,]+(?=[A-Za-z_]\w*\s*=)")


class SensorPreset(BaseModel):
    """The file of a sensor preset.

    Attributes:
        about: Description; the first sentence names the sensor.
        settings: Settings by name; the others have their default.
        fmcw: Settings of its FMCW radar likewise; empty if it measures ranges only.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    about: str
    settings: dict[str, SourcedValue]
    fmcw: dict[str, SourcedValue] = {}


@functools.cache
def sensor_presets() -> dict[str, SensorPreset]:
    """Read all presets, by name, in alphabetical order."""
    return {
        name: SensorPreset.model_validate(read_preset("sensors", name))
        for name in preset_names("sensors")
    }


def load_settings(name: str, /, **settings: Any) -> SensorSettings:
    """Return the settings of a preset, with some of them changed.

    Raises:
        PresetError: If there is no such preset or setting, or a value is invalid; one
            line for each problem.
    """
    presets = sensor_presets()
    if name not in presets:
        raise unknown_preset("sensor", name, preset_names("sensors"))
    values = {key: setting.value for key, setting in presets[name].settings.items()}
    try:
        loaded = SensorSettings.model_validate({**values, **settings})
    except ValidationError as error:
        raise PresetError(_describe(name, error, SensorSettings)) from None
    if loaded.has_detector and not presets[name].fmcw:
        raise PresetError(
            f"sensor {name}: detector {loaded.detector!r}, expected 'penetration', as"
            " it has no spectrum"
        )
    # An error here, not at the first scan: a robot would have been spawned by then.
    if loaded.has_detector and not plugins.has("radarsim.sensors", "fmcw"):
        raise PresetError(
            f"sensor {name}: detector {loaded.detector!r} needs radarsim.addons.fmcw,"
            " which is not installed"
        )
    return loaded


def load_fmcw_settings(name: str, /, **settings: Any) -> FmcwSettings:
    """Return the settings of a preset's FMCW radar, with some of them changed.

    Raises:
        PresetError: If there is no such preset or setting, or it has no such radar, or
            a value is invalid; one line for each problem.
    """
    presets = sensor_presets()
    if name not in presets:
        raise unknown_preset("sensor", name, preset_names("sensors"))
    if not presets[name].fmcw:
        known = ", ".join(each for each, preset in presets.items() if preset.fmcw)
        raise PresetError(f"sensor {name}: no spectrum, expected one of {known}")
    values = {key: setting.value for key, setting in presets[name].fmcw.items()}
    try:
        return FmcwSettings.model_validate({**values, **settings})
    except ValidationError as error:
        raise PresetError(_describe(name, error, FmcwSettings)) from None


def has_fmcw(name: str) -> bool:
    """Return whether a preset describes an FMCW radar."""
    return name in sensor_presets() and bool(sensor_presets()[name].fmcw)


def _describe(name: str, error: ValidationError, model: type[BaseModel]) -> str:
    lines = []
    for problem in error.errors():
        path = ".".join(str(step) for step in problem["loc"])
        text = describe_invalid(problem)
        if problem["type"] == "extra_forbidden":
            expected = expected_one_of(path, sorted(model.model_fields))
            text = f"no setting {expected}"
        elif problem["type"] == "value_error" and path:
            text = f"{path}: {short_repr(problem['input'])}, {text}"
        elif path:
            text = f"{path}: {text}"
        lines.append(f"sensor {name}: {text}")
    return "\n".join(lines)


def parse_settings(text: str) -> dict[str, Any]:
    """Parse several ``KEY=VALUE`` with commas or blanks between them.

    Raises:
        PresetError: If there is none, or more than ``MOST_SETTINGS``, or one is wrong.

    >>> parse_settings("max_range=20, ray_weights=1,2,1 return_mode=first")
    {'max_range': 20, 'ray_weights': [1, 2, 1], 'return_mode': 'first'}
    """
    texts = _NEXT_SETTING.split(text.strip(" ,"), MOST_SETTINGS)
    if len(texts) > MOST_SETTINGS:
        raise PresetError(f"settings {text[:80]!r}, expected at most {MOST_SETTINGS}")
    return dict(map(parse_setting, texts))


def parse_setting(text: str) -> tuple[str, Any]:
    """Parse ``KEY=VALUE``; the value is a number, a word, or a comma-separated list.

    Raises:
        PresetError: If there is no key, or the value is not valid YAML.

    >>> parse_setting("max_range=20")
    ('max_range', 20)
    >>> parse_setting("ray_weights=1,2,1")
    ('ray_weights', [1, 2, 1])
    """
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise PresetError(f"setting {text[:80]!r}, expected KEY=VALUE")
    if "," in value and not value.lstrip().startswith("["):
        value = f"[{value}]"
    try:
        return key.strip(), parse_plain(value)
    except ValueError:
        raise PresetError(f"setting {text[:80]!r}, expected KEY=VALUE") from None
