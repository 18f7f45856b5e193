"""Sensor presets: named settings of scanners."""

import functools
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from radarsim.errors import PresetError
from radarsim.presets.preset_files import (
    SourcedValue,
    preset_names,
    read_preset,
    unknown_preset,
)
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.suggestions import expected_one_of
from radarsim.validation import describe_invalid, short_repr
from radarsim.yaml_reader import parse_plain


class SensorPreset(BaseModel):
    """The file of a sensor preset.

    Attributes:
        about: Description; the first sentence names the sensor.
        settings: Settings by name; the others have their default.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    about: str
    settings: dict[str, SourcedValue]


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
        return SensorSettings.model_validate({**values, **settings})
    except ValidationError as error:
        raise PresetError(_describe(name, error)) from None


def _describe(name: str, error: ValidationError) -> str:
    lines = []
    for problem in error.errors():
        path = ".".join(str(step) for step in problem["loc"])
        text = describe_invalid(problem)
        if problem["type"] == "extra_forbidden":
            expected = expected_one_of(path, sorted(SensorSettings.model_fields))
            text = f"no setting {expected}"
        elif problem["type"] == "value_error" and path:
            text = f"{path}: {short_repr(problem['input'])}, {text}"
        elif path:
            text = f"{path}: {text}"
        lines.append(f"sensor {name}: {text}")
    return "\n".join(lines)


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
