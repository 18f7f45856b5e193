"""Imports sensors and other items of robots from ``UDKUSAR.ini`` of USARSim.

A key may be repeated. Its values are in the notation of Unreal::

    [USARBot.P3AT]
    AddParts=(ItemClass=class'USARSensor.SICK',ItemName="lms200",
        Position=(X=0.2085,Y=0,Z=-0.2),Direction=(X=0,Y=0,Z=0))

Each value is on a single line. Positions are in metres and directions in radians, in a
frame with y to the right and z down. Comments start with a semicolon.
"""

import json
import math
import re
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, TypeAlias

import yaml
from pydantic import ValidationError

from radarsim.addons.imports.source_file import place, read_text, rounded, wrong
from radarsim.errors import expected_one_of
from radarsim.presets.robots import RobotModel, load_robot, robot_names
from radarsim.protocol.message import pose_from_wire
from radarsim.validation import describe_settings, short_repr

BASE: Final = "P3AT"  # classes that are not shipped use the body of this class
# Item types that have the same name as the Unreal class of the part, ignoring case.
_TYPES: Final = (
    *("GroundTruth", "INS", "Odometry", "Tachometer", "Encoder", "Touch", "Sonar"),
    *("GPS", "IMU", "AcceleroMeter", "AltitudeSensor", "MagneticCompass"),
    *("MissionTime", "Battery"),
)
# Item type of each Unreal class; scanners also have a preset.
ITEMS: Final = {each.casefold(): (each, None) for each in _TYPES} | {
    "acceleration": ("Accel", None),
    "gpssensor": ("GPS", None),
    "sonarsensor": ("Sonar", None),
    "touchsensor": ("Touch", None),
    "sick": ("RangeScanner", "usarsim_sick"),
    "hokuyourg04lx": ("RangeScanner", "usarsim_hokuyo"),
    "rangescanner": ("RangeScanner", "usarsim_rangescanner"),
}
_UNCOMMENTED: Final = re.compile(r'(?:[^;"]|"[^"]*(?:"|$))*')
_SECTION: Final = re.compile(r"\[(?:\w+\.)?(\w+)\]")
_KEY: Final = re.compile(r"[+.!-]?(\w+)\s*=\s*(.*)")
# Tokens of structs: quoted texts, class names, field names, parentheses and tabs.
_TOKEN: Final = re.compile(r"\"[^\"]*\"|\w*'([^']*)'|(\w+)\s*=|[()\t]")
_SIGNS: Final = {"(": "{", ")": "}", "\t": " "}  # replacements in YAML

Struct: TypeAlias = dict[str, Any]  # texts and structs by names in lower case
Sections: TypeAlias = dict[str, list[tuple[int, str, str]]]  # lines: number, key, value


def import_ini(path: Path, class_name: str | None) -> tuple[RobotModel, list[str]]:
    """Import a robot class: the items of the file on the body of a shipped class.

    Args:
        path: The file.
        class_name: Name of the class; None for the only class with parts.

    Returns:
        The class, and notes on parts that are left out, with file and line.

    Raises:
        ForeignFileError: If the file cannot be read, or has no such class.
    """
    sections = _read_sections(path)
    name = _choose(path, sections, class_name)
    shipped = {each.casefold(): each for each in robot_names()}
    body = load_robot(shipped.get(name.casefold(), BASE))
    notes = []
    if name.casefold() not in shipped:
        notes.append(place(path, 1, f"{name} has the size and wheels of a {BASE}"))
    items = []
    for number, key, value in sections[name]:
        if key.casefold() != "addparts":
            notes.append(place(path, number, f"the key {key!r} is ignored"))
            continue
        part = _parse_struct(path, number, value)
        item = _item_of(path, number, part)
        if item is None:
            text = f"a part of class {_class_of(part)!r} is left out"
            notes.append(place(path, number, text))
        else:
            items.append(item)
    # Size, wheels and dynamics are copied from the shipped class; only items differ.
    content = body.model_dump(exclude_unset=True) | {"name": name, "items": items}
    try:
        return RobotModel.model_validate(content), notes
    except ValidationError as error:
        problem = describe_settings(error, RobotModel)[0]
        raise wrong(path, 1, f"{name}: {problem}") from error


def _choose(path: Path, sections: Sections, class_name: str | None) -> str:
    """Return the name of the section that describes a robot class."""
    named = [
        name
        for name, lines in sections.items()
        if "addparts" in (key.casefold() for _, key, _ in lines)
    ]
    if class_name is not None:
        for name in sections:
            if name.casefold() == class_name.casefold():
                return name
        raise wrong(path, 1, f"class {expected_one_of(class_name, named)}")
    if len(named) != 1:
        kinds = ", ".join(named)[:200] or "none"
        text = f"classes with AddParts: {kinds}; expected one, or --robot CLASS"
        raise wrong(path, 1, text)
    return named[0]


def _read_sections(path: Path) -> Sections:
    """Return the keys of all sections of the file, by class name."""
    sections: Sections = {}
    lines = None
    for number, line in enumerate(read_text(path).split("\n"), 1):
        # A semicolon in quotes does not start a comment.
        text = _UNCOMMENTED.match(line)[0].strip()  # type: ignore[index]
        if not text:
            continue
        if head := _SECTION.fullmatch(text):
            lines = sections.setdefault(head[1], [])
        elif key := _KEY.fullmatch(text):
            if lines is None:
                raise wrong(path, number, "a key before the first '[section]' line")
            lines.append((number, key[1], key[2].strip()))
        else:
            expected = "expected '[section]' or 'Key=Value'"
            raise wrong(path, number, f"{short_repr(text)}, {expected}")
    return sections


def _parse_struct(path: Path, number: int, text: str) -> Struct:
    """Parse an Unreal struct by rewriting its brackets and separators to YAML."""

    def to_yaml(token: re.Match[str]) -> str:
        if token[2]:
            return f"{token[2].casefold()}: "
        return _SIGNS.get(token[0]) or json.dumps(token[1] or token[0].strip('"'))

    found = None
    with suppress(yaml.YAMLError, RecursionError):  # deep nesting raises RecursionError
        found = yaml.load(_TOKEN.sub(to_yaml, text), yaml.BaseLoader)  # all as texts
    if not isinstance(found, dict):
        expected = "expected (ItemClass=class'...', ItemName=\"...\", ...)"
        raise wrong(path, number, f"{short_repr(text)}, {expected}")
    return found


def _item_of(path: Path, number: int, part: Struct) -> dict[str, object] | None:
    """Return the robot item for a part of the file; None if its class is unknown."""
    known = ITEMS.get(_class_of(part).casefold())
    if known is None:
        return None
    position = _vector(path, number, part, "position")
    direction = _vector(path, number, part, "direction")
    # In the frames of Unreal and of the protocol, y points to the right and z down.
    pose = pose_from_wire([*position, *direction])
    type_, sensor = known
    name = part.get("itemname")
    item: dict[str, object] = {"type": type_, "name": type_}
    if isinstance(name, str) and name:
        item["name"] = name
    if any(pose.position()):
        item["position"] = rounded(pose.position())
    angles = pose.roll, pose.pitch, pose.yaw
    if any(angles):
        item["rotation_deg"] = rounded(map(math.degrees, angles))
    if sensor is not None:
        item["sensor"] = sensor
    return item


def _class_of(part: Struct) -> str:
    """Return the class name of a part, without the Unreal package before the dot."""
    name = part.get("itemclass", "")
    return name.rpartition(".")[2] if isinstance(name, str) else ""


def _vector(path: Path, number: int, part: Struct, key: str) -> list[float]:
    """Return x, y and z of a vector; missing components are 0."""
    given = part.get(key, {})
    try:
        numbers = [float(given.get(axis, 0.0)) for axis in "xyz"]
    except (AttributeError, TypeError, ValueError):
        numbers = [math.nan]
    if not all(map(math.isfinite, numbers)):
        text = f"{key} {short_repr(given)}, expected (X=number,Y=number,Z=number)"
        raise wrong(path, number, text)
    return numbers
