"""The grammar of one line: ``VERB {Key value} {Key value}``.

Blanks around and inside of braces do not count, nor does text between two groups.
Groups do not nest. Keys are found whatever their case, and the first of two equal
ones counts. Verbs keep their case here, since clients tell replies apart by it.
"""

import re
from dataclasses import dataclass

from radarsim.errors import MalformedMessage

_GROUP = re.compile(r"\{([^{}]*)\}")


@dataclass(frozen=True, slots=True)
class Message:
    """One line: its verb and its groups, key and value, in their order.

    A group without a value, ``{Name }``, has an empty one; one without a key is left
    out. The value of a list of start poses or of an item's mount holds blanks.
    """

    verb: str
    segments: tuple[tuple[str, str], ...] = ()

    def get(self, key: str) -> str | None:
        """Give the first value of a key, whatever its case, or None."""
        wanted = key.lower()
        for name, value in self.segments:
            if name.lower() == wanted:
                return value
        return None

    def encode(self) -> str:
        """Write the line, without a line end."""
        groups = [f"{{{f'{key} {value}'.rstrip()}}}" for key, value in self.segments]
        return " ".join([self.verb, *groups])


def decode_message(line: str) -> Message:
    """Read one line.

    >>> decode_message("DRIVE{Left 1}{ Right  -0,5 }")
    Message(verb='DRIVE', segments=(('Left', '1'), ('Right', '-0,5')))

    Raises:
        MalformedMessage: If there is no verb, if text other than a group follows
            it, or if a brace stays open.
    """
    head, _, _ = line.partition("{")
    if not head.strip():
        raise _expected("a verb", 0, line)
    verb, *rest = head.split(maxsplit=1)
    if rest:
        raise _expected("'{Key value}'", len(head) - len(rest[0]), line)
    groups = _GROUP.findall(line)
    if len(groups) != line.count("{"):
        raise _expected("'}' after the brace", _open_brace(line), line)
    return Message(verb, tuple(_split(group) for group in groups if group.strip()))


def _split(group: str) -> tuple[str, str]:
    key, *rest = group.split(maxsplit=1)
    return key, rest[0].rstrip() if rest else ""


def _open_brace(line: str) -> int:
    """Find the first brace that is not closed before the next one opens."""
    closed = {match.start() for match in _GROUP.finditer(line)}
    return next(i for i, sign in enumerate(line) if sign == "{" and i not in closed)


def _expected(what: str, index: int, line: str) -> MalformedMessage:
    return MalformedMessage(f"expected {what} at column {index + 1} in {line[:80]!r}")
