"""The host that a test asks for.

Apart from the fixtures, because it imports the engine, Embree and shapely.
"""

from pathlib import Path
from typing import Annotated, Any, Literal

from annotated_types import Ge, Gt
from pydantic import BaseModel, ConfigDict, FiniteFloat, ValidationError

from radarsim.protocol.dialect import get_dialect
from radarsim.scene.map_file import load_map
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig
from radarsim.validation import describe_invalid


class _Options(BaseModel):
    model_config = ConfigDict(strict=True)

    map: str | Path
    seed: Annotated[int, Ge(0)]
    dialect: Literal["compat", "udk"]
    speed: Annotated[FiniteFloat, Gt(0)]
    settings: dict[str, dict[str, Any]]


def make_host(options: dict[str, Any]) -> Host:
    """Create the host for the options of a test.

    Raises:
        RadarsimError: If the map or the settings are wrong.
        ValueError: If another option is, or is of another type.
    """
    try:
        checked = _Options.model_validate(options)
    except ValidationError as error:
        first = error.errors()[0]
        raise ValueError(f"{first['loc'][0]} {describe_invalid(first)}") from None
    dialect = get_dialect(checked.dialect)
    scene = load_map(checked.map)
    config = SimulationConfig(dialect, item_settings=checked.settings)
    return Host(scene, config=config, seed=checked.seed)
