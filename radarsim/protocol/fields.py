"""One field of a line, all fields of an item, and what an error says of them."""

import math
from collections.abc import Callable, Iterator
from typing import TypeVar

from radarsim.errors import MalformedMessage
from radarsim.protocol.axes import Triple, turn_over
from radarsim.protocol.numbers import read_number, read_numbers
from radarsim.protocol.wire import Message

Value = TypeVar("Value")


def needed(message: Message, key: str) -> str:
    """Give the text of a field that must be there, and not be empty.

    Raises:
        MalformedMessage: If it is not.
    """
    value = message.get(key)
    if not value:
        raise MalformedMessage(
            f"{message.encode()[:80]!r}, expected a field '{{{key} ...}}'"
        )
    return value


def read_needed(message: Message, key: str, read: Callable[[str], Value]) -> Value:
    """Read a field that must be there.

    Raises:
        MalformedMessage: If it is not, or cannot be read; says which field it is.
    """
    return _read(message, key, needed(message, key), read)


def read_if_there(
    message: Message, key: str, read: Callable[[str], Value]
) -> Value | None:
    """Read a field; None if it is missing or empty.

    Raises:
        MalformedMessage: If it cannot be read; says which field it is.
    """
    text = message.get(key)
    return _read(message, key, text, read) if text else None


def read_triple(text: str) -> Triple:
    """Read three numbers as they are written.

    Raises:
        MalformedMessage: If these are not three numbers.
    """
    first, second, third = read_numbers(text, 3)
    return (first, second, third)


def read_turned(text: str) -> Triple:
    """Read x, y, z or roll, pitch, yaw of the wire; give them in the other frame.

    Raises:
        MalformedMessage: If these are not three numbers.
    """
    return turn_over(read_triple(text))


def number_or_nan(message: Message, key: str) -> float:
    """Read a number that a client can do without; not a number if it is missing.

    Raises:
        MalformedMessage: If it is there and cannot be read.
    """
    number = read_if_there(message, key, read_number)
    return math.nan if number is None else number


def name_of(message: Message) -> str:
    """Give the name of whatever the line or item is about, or an empty one."""
    return message.get("Name") or ""


def items_of(message: Message) -> Iterator[Message]:
    """Give the fields of each item; the next one begins where a key comes again."""
    item: list[tuple[str, str]] = []
    seen: set[str] = set()
    for key, value in message.segments:
        word = key.lower()
        if word in ("type", "time"):
            continue
        if word in seen:
            yield Message(message.verb, tuple(item))
            item.clear()
            seen.clear()
        item.append((key, value))
        seen.add(word)
    if item:
        yield Message(message.verb, tuple(item))


def _read(message: Message, key: str, text: str, read: Callable[[str], Value]) -> Value:
    try:
        return read(text)
    except MalformedMessage as error:
        raise MalformedMessage(f"{message.verb} {key}: {error}") from None
