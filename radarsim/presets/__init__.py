"""Finds and reads the YAML files of the presets that come with radarsim.

The folders ``sensors``, ``items``, ``materials`` and ``robots`` have one file for each
preset, with its name. Every number states its source.
"""

from functools import cache
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

from pydantic import BaseModel

from radarsim.yaml_reader import parse_plain

Folder: TypeAlias = Literal["sensors", "items", "materials", "robots"]
Confidence: TypeAlias = Literal["verified", "nominal", "estimate", "choice"]

_PACKAGE: Final = Path(__file__).parent


class SourcedValue(BaseModel, extra="forbid", frozen=True):
    """A value in a preset, with the source from which it was taken.

    Attributes:
        value: The value itself.
        source: Origin of the value, as text.
        confidence: ``verified`` if the value was read in its source, ``nominal`` if it
            is recalled from a data sheet, ``estimate`` if it is an engineering
            judgement, ``choice`` if this project chose it.
    """

    value: Any
    source: str
    confidence: Confidence


@cache
def preset_names(folder: Folder) -> tuple[str, ...]:
    """Return the sorted names of the presets in a folder, such as ``sensors``."""
    return tuple(sorted(path.stem for path in (_PACKAGE / folder).glob("*.yaml")))


def preset_path(folder: Folder, name: str) -> Path:
    """Return the path of a preset's file, even if there is no such preset."""
    return _PACKAGE / folder / f"{name}.yaml"


def read_preset(folder: Folder, name: str) -> Any:
    """Return the parsed YAML file of an existing preset."""
    text = preset_path(folder, name).read_text(encoding="utf-8")
    return parse_plain(text)
