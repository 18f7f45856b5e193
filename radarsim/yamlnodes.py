"""From YAML text to nodes: values with their line and column.

YAML 1.2 with the core schema, so ``1e-3`` is a number, ``on`` and ``12:30`` are text.
The parser's events are read here one by one and not handed to a constructor, because
tags are refused, and so are keys that stand twice, numbers that are not finite, and
aliases that multiply into more than any file that is written out would hold.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    Event,
    MappingEndEvent,
    NodeEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)
from ruamel.yaml.reader import ReaderError

KeyPath: TypeAlias = tuple[str | int, ...]
Place: TypeAlias = tuple[int, int]

MAX_VALUES = 500_000  # with aliases written out
MAX_DEPTH = 32  # of lists and dicts, also of those that stand as keys

_INTEGER = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_WORDS: dict[str, bool | None] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}


@dataclass(frozen=True)
class Node:
    """A value and its place.

    Attributes:
        place: Line and column, counted from 1.
        value: A scalar, a list of nodes, or a dict of nodes.
        key_places: Where the keys of a dict stand.
        weight: The number of values in it, itself included.
        height: The number of levels in it, 0 for a scalar.
    """

    place: Place
    value: Any
    key_places: dict[str, Place] = field(default_factory=dict)
    weight: int = 1
    height: int = 0

    def plain(self) -> Any:
        """Give the value without places."""
        if isinstance(self.value, dict):
            return {key: node.plain() for key, node in self.value.items()}
        if isinstance(self.value, list):
            return [node.plain() for node in self.value]
        return self.value


@dataclass(frozen=True)
class Found:
    """A problem with the text as YAML."""

    place: Place
    path: KeyPath
    message: str


class Unreadable(Exception):
    """Nothing after a place can be read."""

    def __init__(self, place: Place, message: str) -> None:
        super().__init__(message)
        self.place = place
        self.message = message


def read_nodes(text: str) -> tuple[Node, list[Found]]:
    """Read the one document in a text.

    Returns:
        Its root, and all the problems that reading can go past.

    Raises:
        Unreadable: At the first problem that it can't.
    """
    reader = _Reader(YAML(typ="safe", pure=True).parse(text))
    try:
        return reader.document(), reader.found
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = (mark.line + 1, mark.column + 1) if mark else (1, 1)
        reason = error.problem or error.context
    except ReaderError as error:
        before = text[: error.position]
        place = (before.count("\n") + 1, len(before) - before.rfind("\n"))
        reason = f"character {text[error.position]!r}"
    raise Unreadable(place, f"not YAML: {reason}")


class _Reader:
    """Builds nodes from the events of a YAML stream and collects problems."""

    def __init__(self, events: Iterator[Event]) -> None:
        self.found: list[Found] = []
        self._events = events
        self._anchors: dict[str, Node] = {}
        self._values = 0

    def document(self) -> Node:
        """Read to the end of the stream."""
        root: Node | None = None
        for event in self._events:
            if isinstance(event, DocumentStartEvent) and root is not None:
                raise Unreadable(_place(event), "a second document, expected one")
            if isinstance(event, NodeEvent):
                root = self._node(event, ())
        return root or Node((1, 1), None)

    def _node(self, event: Any, path: KeyPath) -> Node:
        if isinstance(event, AliasEvent):
            return self._alias(event, path)
        self._weigh(event, 1, len(path))
        if event.tag is not None:
            self._report(event, path, f"tag {_cut(event.tag)}, expected none")
        if isinstance(event, ScalarEvent):
            node = Node(_place(event), self._scalar(event, path))
        elif isinstance(event, SequenceStartEvent):
            node = self._sequence(event, path)
        else:
            node = self._mapping(event, path)
        if event.anchor is not None:
            self._anchors[event.anchor] = node
        return node

    def _alias(self, event: Any, path: KeyPath) -> Node:
        node = self._anchors.get(event.anchor)
        if node is None:  # or the alias stands inside of what it names
            message = f"alias {_cut(event.anchor)}, expected an anchor before it"
            self._report(event, path, message)
            return Node(_place(event), None)
        self._weigh(event, node.weight, len(path) + node.height)
        return node

    def _sequence(self, event: Event, path: KeyPath) -> Node:
        items: list[Node] = []
        while not isinstance(item := next(self._events), SequenceEndEvent):
            items.append(self._node(item, (*path, len(items))))
        return Node(_place(event), items, {}, *_size(items))

    def _mapping(self, event: Event, path: KeyPath) -> Node:
        values: dict[str, Node] = {}
        places: dict[str, Place] = {}
        while not isinstance(item := next(self._events), MappingEndEvent):
            key = self._key(item, path)
            value = self._node(next(self._events), (*path, key))
            if key in values:
                first = f"first in line {places[key][0]}"
                self._report(item, (*path, key), f"key stands twice, {first}")
            else:
                values[key], places[key] = value, _place(item)
        return Node(_place(event), values, places, *_size(list(values.values())))

    def _key(self, event: Any, path: KeyPath) -> str:
        if isinstance(event, ScalarEvent) and event.tag is None:
            return str(event.value)
        self._node(event, (*path, "?"))
        self._report(event, path, "a key that is no plain text, expected a name")
        return ""

    def _scalar(self, event: ScalarEvent, path: KeyPath) -> Any:
        text = str(event.value)
        if event.style is not None:  # quoted, or a block of text
            return text
        if text in _WORDS:
            return _WORDS[text]
        value = _number_or_text(text)
        if isinstance(value, float) and not math.isfinite(value):
            self._report(event, path, f"{_cut(text)}, expected a finite number")
            return 1.0  # anything that causes no further problems
        return value

    def _weigh(self, event: Event, weight: int, depth: int) -> None:
        self._values += weight
        if self._values > MAX_VALUES:
            raise Unreadable(_place(event), f"more than {MAX_VALUES} values")
        if depth > MAX_DEPTH:
            raise Unreadable(_place(event), f"more than {MAX_DEPTH} levels")

    def _report(self, event: Event, path: KeyPath, message: str) -> None:
        self.found.append(Found(_place(event), path, message))


def _number_or_text(text: str) -> str | int | float:
    """Read a plain scalar as the core schema does; 300 digits count as infinite."""
    if _INTEGER.fullmatch(text):
        if len(text) > 300:
            return math.inf
        return int(text, 0) if text[:2] in ("0o", "0x") else int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    return math.inf if _NOT_FINITE.fullmatch(text) else text


def _size(nodes: list[Node]) -> tuple[int, int]:
    """Give weight and height of a list or dict of these."""
    weight = 1 + sum(node.weight for node in nodes)
    return weight, 1 + max((node.height for node in nodes), default=0)


def _place(event: Event) -> Place:
    return event.start_mark.line + 1, event.start_mark.column + 1


def _cut(value: object) -> str:
    return repr(value)[:80]
