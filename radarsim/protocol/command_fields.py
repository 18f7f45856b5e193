"""The fields of commands: one table for each command, which reads and writes its line.

An attribute of a command is annotated with its key and how its text is read and
written; see ``fields`` for reports. Fields come in any order, and an empty field is a
missing one, which leaves the attribute its default.

Written numbers have all their digits and no exponent, vectors have commas, and truth
values are lower case: servers of all generations read that.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, ClassVar, Final, Self, TypeAlias

import numpy as np

from radarsim.errors import MalformedMessage, expected_one_of
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.fields import fields_of
from radarsim.protocol.message import (
    LARGEST_COMMANDED,
    Message,
    Triple,
    flip_axes,
    parse_flag,
    parse_flipped,
    parse_number,
)

Values: TypeAlias = Sequence[str | None]  # one for each key; None leaves it out
Read: TypeAlias = Callable[[str], Any]
Write: TypeAlias = Callable[[Any], str | None]


class Key:
    """How an attribute of a command is read and written."""

    def __init__(
        self,
        key: str,
        read: Read = str,
        write: Write = lambda text: text or None,
        *,
        words: Sequence[str] = (),
        is_required: bool = False,
    ) -> None:
        """Describe the field.

        Args:
            key: Its key.
            read: Reads its text, which is not empty.
            write: Returns its text for a value that is not None.
            words: Its values, which are written in any case; empty for any value.
            is_required: Whether a command without it is malformed.
        """
        self.key, self.read, self.write = key, read, write
        self.words, self.is_required = words, is_required

    def decode(self, message: Message) -> Any:
        """Read the attribute; None if the field is missing.

        Raises:
            MalformedMessage: If it is required, or not readable.
        """
        parse = message.parse if self.is_required else message.parse_optional
        value = parse(self.key, self.read)
        if value is None or not self.words:
            return value
        for word in self.words:
            if word.lower() == value.lower():
                return word
        expected = expected_one_of(value, list(map(str, self.words)))
        raise MalformedMessage(f"{self.key} {expected}")


def _keys_of(command: type) -> Sequence[tuple[str, Key]]:
    found: Sequence[tuple[str, Any]] = fields_of(command)
    return found


class KeyedCommand:
    """A command whose line follows from the keys of its attributes.

    Attributes:
        verb: First word of the line.
    """

    verb: ClassVar[str]

    @classmethod
    def decode(cls, message: Message, _: Dialect) -> Self:
        """Read the command from its message.

        Raises:
            MalformedMessage: If a field is missing or not readable.
        """
        values = {}
        for name, key in _keys_of(cls):
            value = key.decode(message)
            if value is not None:
                values[name] = value
        create: Callable[..., Self] = cls
        return create(**values)

    @property
    def keys(self) -> Sequence[str]:
        """The keys of its fields."""
        return [key.key for _, key in _keys_of(type(self))]

    def values(self) -> Values:
        """Return the text for each of ``keys``."""
        texts: list[str | None] = []
        for name, key in _keys_of(type(self)):
            value = getattr(self, name)
            texts.append(None if value is None else key.write(value))
        return texts


def format_number(value: float) -> str:
    """Write a number.

    Raises:
        ValueError: If it is not finite, or too large to be read.
    """
    if not math.isfinite(value) or abs(value) > LARGEST_COMMANDED:
        limit = f"at most {LARGEST_COMMANDED:g} in size"
        raise ValueError(f"number {value!r}, expected {limit}")
    # The sum makes 0.0 of -0.0, whose sign no server needs.
    return np.format_float_positional(value + 0.0, trim="0")


def format_vector(values: Sequence[float]) -> str:
    """Write numbers with commas between them; errors as of ``format_number``."""
    return ",".join(map(format_number, values))


def format_flag(value: bool) -> str:
    """Write a truth value."""
    return str(value).lower()


def format_if_true(value: bool) -> str | None:
    """Write a truth value that is false where it is missing."""
    return "true" if value else None


def format_place(values: Triple) -> str:
    """Write x, y, z or roll, pitch, yaw in the axes of the wire."""
    return format_vector(flip_axes(values))


def _parse_angle(text: str) -> float:
    return 0.0 - parse_commanded(text)


parse_commanded: Final = partial(parse_number, largest=LARGEST_COMMANDED)
parse_place: Final = partial(parse_flipped, largest=LARGEST_COMMANDED)
NUMBER: Final = parse_commanded, format_number
# On the wire the right is positive.
ANGLE: Final = _parse_angle, lambda value: format_number(-value)
FLAG: Final = parse_flag, format_flag
SWITCH: Final = parse_flag, format_if_true
