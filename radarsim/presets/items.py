"""Settings of the items that cast rays and are no scanners: sonars and GPS receivers.

Each type has a preset of the same name in lower case.
"""

from functools import cache
from typing import Annotated, Any, TypeAlias, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from radarsim.errors import PresetError, expected_one_of
from radarsim.presets.preset_files import preset_names, read_preset
from radarsim.presets.sensor_settings import NotNegative, Positive
from radarsim.presets.sensors import SensorPreset
from radarsim.validation import describe_invalid

RightAngle: TypeAlias = Annotated[float, Field(ge=1, le=90, allow_inf_nan=False)]


class SonarSettings(BaseModel):
    """All settings of a sonar.

    Attributes:
        beam_angle_deg: Angle of the whole cone, degrees.
        min_range: Shortest range that is read, m; shorter ones read it as well.
        max_range: Longest range that is read, m; so does a cone without return.
        max_incidence_deg: Largest angle between a ray and the normal of a surface that
            sends sound back, degrees; the ray on the axis has no such limit.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    beam_angle_deg: RightAngle
    min_range: NotNegative
    max_range: Positive
    max_incidence_deg: RightAngle


class GpsSettings(BaseModel):
    """All settings of a GPS receiver.

    Attributes:
        max_noise: Three standard deviations of north and east with 4 satellites, m.
        min_noise: Three standard deviations of north and east with 12 satellites, m.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    max_noise: NotNegative
    min_noise: NotNegative


_Settings = TypeVar("_Settings", SonarSettings, GpsSettings)


@cache
def item_presets() -> dict[str, SensorPreset]:
    """Read the presets of all types, by name, in alphabetical order."""
    return {
        name: SensorPreset.model_validate(read_preset("items", name))
        for name in preset_names("items")
    }


def sonar_settings(**settings: Any) -> SonarSettings:
    """Return the settings of the sonar's preset, with some of them changed.

    Raises:
        PresetError: If there is no such setting, or a value is invalid; one line for
            each problem.
    """
    return _load("sonar", SonarSettings, settings)


def gps_settings(**settings: Any) -> GpsSettings:
    """Return the settings of the GPS receiver's preset, with some of them changed.

    Raises:
        PresetError: If there is no such setting, or a value is invalid; one line for
            each problem.
    """
    return _load("gps", GpsSettings, settings)


def _load(name: str, model: type[_Settings], settings: dict[str, Any]) -> _Settings:
    preset = item_presets()[name]
    values = {key: setting.value for key, setting in preset.settings.items()}
    try:
        return model.model_validate({**values, **settings})
    except ValidationError as error:
        known = sorted(model.model_fields)
        lines = []
        for problem in error.errors():
            key = ".".join(str(step) for step in problem["loc"])
            text = f"{key}: {describe_invalid(problem)}"
            if problem["type"] == "extra_forbidden":
                text = f"no setting {expected_one_of(key, known)}"
            lines.append(f"{name}: {text}")
        raise PresetError("\n".join(lines)) from None
