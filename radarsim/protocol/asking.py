"""Commands to lines: what a client says, so that ``parse_command`` reads it back.

Numbers are written with all their digits and without an exponent, vectors with commas,
and truth values in small letters, which servers of all generations read.
"""

import math
from collections.abc import Iterable
from functools import singledispatch

import numpy as np

from radarsim.protocol.axes import turn_over
from radarsim.protocol.commands import (
    Command,
    Drive,
    GetConf,
    GetGeo,
    GetStartPoses,
    Init,
    SetItem,
    Unsupported,
)
from radarsim.protocol.numbers import LARGEST_READ
from radarsim.protocol.wire import Message

PACKAGE = "USARBot."  # of robot classes


def encode_command(command: Command) -> str:
    """Write a command as one line, without its end.

    Raises:
        ValueError: If a number in it is not finite or too large to be read, or a text
            has line ends, braces or what is not ASCII.
    """
    return _line(command)


@singledispatch
def _line(command: object) -> str:
    raise TypeError(f"{command!r}, expected a command")


@_line.register
def _(command: Init) -> str:
    class_name = command.class_name
    if "." not in class_name:
        class_name = PACKAGE + class_name
    location, rotation = command.position, command.rotation
    return _text(
        "INIT",
        ("ClassName", class_name),
        ("Name", command.name),
        ("Start", command.start),
        ("Location", None if location is None else _vector(turn_over(location))),
        ("Rotation", None if rotation is None else _vector(turn_over(rotation))),
    )


@_line.register
def _(command: Drive) -> str:
    return _text(
        "DRIVE",
        ("Left", _number_if_given(command.left)),
        ("Right", _number_if_given(command.right)),
        ("Normalized", _flag_if_given(command.normalized)),
        ("Light", _flag_if_given(command.light)),
        ("Flip", _flag_if_given(command.flip)),
    )


@_line.register
def _(_: GetStartPoses) -> str:
    return _text("GETSTARTPOSES")


@_line.register
def _(command: GetGeo) -> str:
    return _text("GETGEO", ("Type", command.type), ("Name", command.name))


@_line.register
def _(command: GetConf) -> str:
    return _text("GETCONF", ("Type", command.type), ("Name", command.name))


@_line.register
def _(command: SetItem) -> str:
    return _text(
        "SET",
        ("Type", command.type),
        ("Name", command.name),
        ("Opcode", command.opcode),
        ("Params", command.params or None),
    )


@_line.register
def _(command: Unsupported) -> str:
    return _text(command.verb)


def _text(verb: str, *fields: tuple[str, str | None]) -> str:
    given = tuple((key, _checked(text)) for key, text in fields if text is not None)
    return Message(verb, given).encode()


def _checked(text: str) -> str:
    """Give a text back if a line can hold it: another's line must not be in it."""
    if text.isascii() and text.isprintable() and not {*text} & {"{", "}"}:
        return text
    raise ValueError(f"text {text[:80]!r}, expected printable ASCII without braces")


def _number_if_given(value: float | None) -> str | None:
    return None if value is None else _number(value)


def _flag_if_given(value: bool | None) -> str | None:
    return None if value is None else str(value).lower()


def _vector(values: Iterable[float]) -> str:
    return ",".join([_number(value) for value in values])


def _number(value: float) -> str:
    if not math.isfinite(value) or abs(value) > LARGEST_READ:
        raise ValueError(f"number {value!r}, expected at most {LARGEST_READ:g} in size")
    return np.format_float_positional(value + 0.0, trim="0")
