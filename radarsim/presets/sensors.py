"""Presets of sensors: named settings of scanners, and settings of other items."""

import re
from functools import cache
from typing import Final, TypeVar

from pydantic import BaseModel, ValidationError

from radarsim import plugins
from radarsim.errors import PresetError, expected_one_of
from radarsim.presets import Folder, SourcedValue, preset_names, read_preset
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.validation import describe_settings
from radarsim.yaml_reader import parse_plain

MOST_SETTINGS: Final = len(SensorSettings.model_fields) + 1  # settings in one text

_NEXT_SETTING: Final = re.compile(r"[\s,]+(?=[A-Za-z_]\w*\s*=)")
_Settings = TypeVar("_Settings", bound=BaseModel)


class SensorPreset(BaseModel, extra="forbid", frozen=True):
    """A preset file of a scanner, or of another item that casts rays.

    Attributes:
        about: Description; the first sentence names the sensor.
        title: Name of the sensor in pictures; empty for the name of the preset.
        settings: Settings by name; missing settings have their defaults.
        fmcw: Settings of the FMCW radar by name; empty for a sensor without one.
    """

    about: str
    title: str = ""
    settings: dict[str, SourcedValue]
    fmcw: dict[str, SourcedValue] = {}


@cache
def sensor_presets(folder: Folder = "sensors") -> dict[str, SensorPreset]:
    """Return all sensor presets in a folder by name, in alphabetical order.

    Args:
        folder: ``sensors`` for presets of scanners, or ``items`` for presets of other
            items, which have the names of item types.
    """
    return {
        name: SensorPreset.model_validate(read_preset(folder, name))
        for name in preset_names(folder)
    }


def load_settings(name: str, /, **settings: object) -> SensorSettings:
    """Return the settings of a scanner preset, with given changes.

    Raises:
        PresetError: If there is no such preset or setting, or a value is invalid; one
            line for each problem.
    """
    preset = _scanner_preset(name)
    label = f"sensor {name}"
    loaded = _validate(label, SensorSettings, preset.settings, settings)
    if loaded.has_detector and not preset.fmcw:
        raise PresetError(
            f"{label}: detector {loaded.detector!r}, expected 'penetration', since the"
            " sensor has no spectrum"
        )
    # Without this check, the missing package would only show at the first scan.
    if loaded.has_detector and not plugins.has("radarsim.sensors", "fmcw"):
        raise PresetError(
            f"sensor {name}: detector {loaded.detector!r} needs radarsim.addons.fmcw,"
            " which is not installed"
        )
    return loaded


def load_fmcw_settings(name: str, /, **settings: object) -> FmcwSettings:
    """Return the settings of the FMCW radar in a scanner preset, with given changes.

    Raises:
        PresetError: If there is no such preset or setting, or the preset has no FMCW
            radar, or a value is invalid; one line for each problem.
    """
    preset = _scanner_preset(name)
    if not preset.fmcw:
        known = ", ".join(each for each in sensor_presets() if has_fmcw(each))
        raise PresetError(f"sensor {name} has no spectrum, expected one of {known}")
    return _validate(f"sensor {name}", FmcwSettings, preset.fmcw, settings)


def item_settings(
    item_type: str, model: type[_Settings], /, **settings: object
) -> _Settings:
    """Return the settings of an item other than a scanner, with given changes.

    Args:
        item_type: Type of the item, such as ``GPS``; a preset may have this name.
        model: Model of the settings of this type.
        **settings: Changed settings by name.

    Raises:
        PresetError: As in ``load_settings``.
    """
    name = item_type.lower()
    preset = sensor_presets("items").get(name)
    return _validate(name, model, preset.settings if preset else {}, settings)


def has_fmcw(name: str) -> bool:
    """Return whether a scanner preset contains settings of an FMCW radar."""
    return name in sensor_presets() and bool(sensor_presets()[name].fmcw)


def _scanner_preset(name: str) -> SensorPreset:
    if name not in sensor_presets():
        raise PresetError(f"sensor {expected_one_of(name, sensor_presets())}")
    return sensor_presets()[name]


def _validate(
    label: str,
    model: type[_Settings],
    preset: dict[str, SourcedValue],
    changes: dict[str, object],
) -> _Settings:
    values = {key: setting.value for key, setting in preset.items()}
    try:
        return model.model_validate({**values, **changes})
    except ValidationError as error:
        problems = describe_settings(error, model)
        raise PresetError("\n".join(f"{label}: {text}" for text in problems)) from None


def parse_settings(text: str) -> dict[str, object]:
    """Parse several ``KEY=VALUE`` settings, separated by commas or blanks.

    Raises:
        PresetError: If there is no setting, or more than ``MOST_SETTINGS``, or one of
            them is invalid.

    >>> parse_settings("max_range=20, ray_weights=1,2,1 return_mode=first")
    {'max_range': 20, 'ray_weights': [1, 2, 1], 'return_mode': 'first'}
    """
    # Blanks separate settings only before a key, so the values may contain blanks.
    texts = _NEXT_SETTING.split(text.strip(" ,"), MOST_SETTINGS)
    if len(texts) > MOST_SETTINGS:
        raise PresetError(f"settings {text[:80]!r}, expected at most {MOST_SETTINGS}")
    return dict(map(parse_setting, texts))


def parse_setting(text: str) -> tuple[str, object]:
    """Parse a setting ``KEY=VALUE``, with a number, word or comma-separated list.

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
    # Lists need no brackets, which users would have to quote in a shell.
    if "," in value and not value.lstrip().startswith("["):
        value = f"[{value}]"
    try:
        return key.strip(), parse_plain(value)
    except ValueError:
        raise PresetError(f"setting {text[:80]!r}, expected KEY=VALUE") from None
