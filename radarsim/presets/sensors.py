"""Sensor presets: YAML files whose every number says where it is from."""

import functools
from importlib.resources import files
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from radarsim.errors import PresetError
from radarsim.presets.sensor_settings import SensorSettings


class SourcedValue(BaseModel):
    """A setting of a preset, with its origin.

    Attributes:
        value: As in ``SensorSettings``.
        source: Where it is from, in words.
        confidence: ``verified`` if it was read in its source, ``nominal`` if it is
            recalled from a data sheet, ``estimate`` if it is judged, ``choice`` if
            this project has decided it.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    value: Any
    source: str
    confidence: Literal["verified", "nominal", "estimate", "choice"]


class SensorPreset(BaseModel):
    """A preset file.

    Attributes:
        about: One sentence.
        settings: The numbers by name.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    about: str
    settings: dict[str, SourcedValue]


@functools.cache
def sensor_presets() -> dict[str, SensorPreset]:
    """Read all presets, by name, in alphabetical order."""
    folder = files("radarsim.presets") / "sensors"
    yaml = YAML(typ="safe", pure=True)
    names = sorted(
        file.name for file in folder.iterdir() if file.name.endswith(".yaml")
    )
    return {
        name.removesuffix(".yaml"): SensorPreset.model_validate(
            yaml.load((folder / name).read_text(encoding="utf-8"))
        )
        for name in names
    }


def load_settings(name: str, /, **settings: Any) -> SensorSettings:
    """Take a preset and change some of its settings.

    Raises:
        PresetError: If there is no such preset or setting, or a value does not fit;
            names all that is wrong.
    """
    presets = sensor_presets()
    if name not in presets:
        raise PresetError(f"sensor {name[:80]!r}, expected one of {sorted(presets)}")
    values = {key: number.value for key, number in presets[name].settings.items()}
    try:
        return SensorSettings.model_validate({**values, **settings})
    except ValidationError as error:
        raise PresetError(_texts(name, error)) from None


def _texts(name: str, error: ValidationError) -> str:
    lines = []
    for problem in error.errors():
        path = ".".join(str(step) for step in problem["loc"])
        if problem["type"] == "extra_forbidden":
            known = sorted(SensorSettings.model_fields)
            lines.append(f"sensor {name}: no setting {path!r}, expected one of {known}")
        elif not path:
            lines.append(f"sensor {name}: {_lowered(problem['msg'])}")
        else:
            came = repr(problem["input"])[:80]
            lines.append(f"sensor {name}: {path}: {came}: {_lowered(problem['msg'])}")
    return "\n".join(lines)


def _lowered(text: str) -> str:
    text = text.removeprefix("Value error, ")
    return text[:1].lower() + text[1:]


def parse_setting(text: str) -> tuple[str, Any]:
    """Read ``KEY=VALUE``; the value is a number, a word, or numbers between commas.

    Raises:
        PresetError: If there is no key, or the value cannot be read.

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
        return key.strip(), YAML(typ="safe", pure=True).load(value)
    except YAMLError:
        raise PresetError(f"setting {text[:80]!r}, expected KEY=VALUE") from None
