"""Sensor presets: YAML files whose every number says where it is from."""

import functools
import math
from importlib.resources import files
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from radarsim.errors import PresetError

Finite = Annotated[float, Field(allow_inf_nan=False)]
# The largest scene is 1 km wide; numbers far beyond it overflow somewhere.
Positive = Annotated[float, Field(ge=1e-3, le=1e5, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, le=1e5, allow_inf_nan=False)]

SETTINGS_OF_RADARS = frozenset(
    {"side_offset_uu", "side_mode", "divergence_distance", "ray_weights"}
)


class SensorSettings(BaseModel):
    """What makes a scanner the one that it is.

    Attributes:
        medium: Whether its beams are ``radar`` waves or ``laser`` light: which
            densities of the materials count.
        fov_deg: Angle between the first beam and the last.
        resolution_deg: Angle between neighbouring beams.
        max_range: m, inclusive.
        min_range: m; told to clients, and applied to nothing, as in USARSim.
        penetration_power: What a beam can lose to densities; infinite for one that
            nothing but an opaque surface stops.
        spent_reads: What a beam reads whose power runs out: the ``range`` of that
            point, or ``zero``, as USARSim's Hokuyo in smoke.
        side_offset_uu: N, how far the side rays are beside their beam, in Unreal units
            of 4 mm; 0 for none.
        side_mode: Where they are: ``perpendicular`` to each beam, ``lateral`` on the
            sensor's left-right axis, or ``divergent`` from one point.
        divergence_distance: m; how far away divergent rays are N units off.
        ray_weights: Chances of the right, centre and left ray to give the range; in
            any unit.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    medium: Literal["radar", "laser"]
    fov_deg: Annotated[float, Field(ge=1e-4, le=360, allow_inf_nan=False)]
    resolution_deg: Annotated[float, Field(ge=1e-4, le=360, allow_inf_nan=False)]
    max_range: Positive
    min_range: NotNegative = 0.0
    penetration_power: Annotated[float, Field(ge=0, allow_inf_nan=True)]
    spent_reads: Literal["range", "zero"] = "range"
    side_offset_uu: NotNegative = 0.0
    side_mode: Literal["perpendicular", "lateral", "divergent"] = "perpendicular"
    divergence_distance: Positive = 10.0
    ray_weights: tuple[NotNegative, NotNegative, NotNegative] = (1.0, 1.0, 1.0)

    @property
    def beams(self) -> int:
        """How many beams a scan has."""
        return round(self.fov_deg / self.resolution_deg) + 1

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if math.isnan(self.penetration_power):
            raise ValueError("penetration_power nan, expected at least 0")
        if sum(self.ray_weights) <= 0:
            raise ValueError(f"ray_weights {self.ray_weights}, expected one above 0")
        if self.resolution_deg > self.fov_deg:
            raise ValueError(
                f"resolution_deg {self.resolution_deg:g}, expected at most"
                f" fov_deg {self.fov_deg:g}"
            )
        if self.beams > MOST_BEAMS:
            raise ValueError(f"{self.beams} beams, expected at most {MOST_BEAMS}")
        return self


MOST_BEAMS = 1_000_000


class Number(BaseModel):
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
    settings: dict[str, Number]


@functools.cache
def sensor_presets() -> dict[str, SensorPreset]:
    """Read all presets, by name, in alphabetical order."""
    folder = files("radarsim.presets") / "scanners"
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


def load_settings(name: str, **settings: Any) -> SensorSettings:
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
            lines.append(
                f"sensor {name}: {problem['msg'].removeprefix('Value error, ')}"
            )
        else:
            came = repr(problem["input"])[:80]
            lines.append(f"sensor {name}: {path}: {came}: {_lowered(problem['msg'])}")
    return "\n".join(lines)


def _lowered(text: str) -> str:
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
