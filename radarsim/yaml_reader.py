"""From YAML text to nodes: values with their line and column.

YAML 1.2 with the core schema, so ``1e-3`` is a number, ``on`` and ``12:30`` are text.
The parser's events are read here one by one and not handed to a constructor, because
tags are refused, and so are keys that stand twice, numbers that are not finite, and
aliases that multiply into more than any file that is written out would hold.
"""

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from pydantic import ValidationError
from pydantic_core import ErrorDetails
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


# Section from yamlfile.
# YAML files: plain data, and the place of everything in it, for error messages.
#
# Whatever is wrong is said as ``file:line:column: key.path: message``, whether the
# text is no YAML or a model refuses the data; see yamlnodes.py for what is no YAML
# here.

MAX_BYTES = 4 * 1024 * 1024

_MESSAGES: dict[str, Callable[[Mapping[str, Any]], str]] = {
    "bool_type": lambda _: "expected true or false",
    "dict_type": lambda _: "expected keys with values",
    "float_type": lambda _: "expected a number",
    "greater_than": lambda limits: f"expected more than {limits['gt']:g}",
    "greater_than_equal": lambda limits: f"expected at least {limits['ge']:g}",
    "int_type": lambda _: "expected a whole number",
    "less_than": lambda limits: f"expected less than {limits['lt']:g}",
    "less_than_equal": lambda limits: f"expected at most {limits['le']:g}",
    "list_type": lambda _: "expected a list",
    "literal_error": lambda context: f"expected {context['expected']}",
    "model_type": lambda _: "expected keys with values",
    "string_too_long": lambda limits: (
        f"expected at most {limits['max_length']} characters"
    ),
    "string_type": lambda _: "expected text",
    "too_long": lambda limits: f"expected {limits['max_length']} entries",
    "too_short": lambda limits: f"expected {limits['min_length']} entries",
}


@dataclass(frozen=True)
class YamlFile:
    """What one YAML file says.

    Attributes:
        path: As it was given; problems begin with it.
        data: Dicts with text as keys, lists, text, numbers, booleans and None; None
            if the file is no YAML.
        problems: What is wrong with the file as YAML, sorted by place.
    """

    path: Path
    data: Any
    problems: tuple[str, ...]
    _root: Node

    def place(self, keys: Sequence[str | int], *, of_key: bool = False) -> str:
        """Give ``file:line:column`` of a value, or of the nearest thing around it.

        Args:
            keys: Keys and list indices from the outside in.
            of_key: Point at the last key instead of at its value.
        """
        node, place = self._root, self._root.place
        for key in keys:
            inner = _step(node, key)
            if inner is None:
                break
            on_key = of_key and isinstance(key, str)
            place = node.key_places[str(key)] if on_key else inner.place
            node = inner
        else:
            return _at(self.path, place)
        return _at(self.path, node.place)

    def problem(
        self, keys: Sequence[str | int], message: str, *, of_key: bool = False
    ) -> str:
        """Say what is wrong at a place: ``file:line:column: key.path: message``."""
        return _join(self.place(keys, of_key=of_key), keys, message)

    def validation_problems(
        self,
        error: ValidationError,
        at: Sequence[str | int] = (),
        *,
        known: Iterable[str] = (),
    ) -> list[str]:
        """Say what a pydantic model refused, one problem for each refusal.

        Args:
            error: What the model raised.
            at: Where the data stands that the model was given.
            known: The model's own keys, for the message about one that is unknown.
        """
        return [self._refusal(details, at, sorted(known)) for details in error.errors()]

    def _refusal(
        self, details: ErrorDetails, at: Sequence[str | int], known: list[str]
    ) -> str:
        inner = [key for key in details["loc"] if key != "[key]"]
        unknown = details["type"] == "extra_forbidden"
        if unknown:
            expected = f", expected one of {known}" if known and len(inner) == 1 else ""
            message = f"unknown key{expected}"
        else:
            message = _message(details)
        return self.problem((*at, *inner), message, of_key=unknown)


def read_yaml(path: Path) -> YamlFile:
    """Read a YAML file.

    Raises:
        OSError: If it cannot be read.
    """
    with path.open("rb") as file:
        content = file.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        return _unreadable(path, (1, 1), f"more than {MAX_BYTES} bytes")
    try:
        return parse_yaml(path, content.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        before = content[: error.start]
        place = (before.count(b"\n") + 1, error.start - before.rfind(b"\n"))
        return _unreadable(path, place, "bytes that are no text, expected UTF-8")


def parse_yaml(path: Path, text: str) -> YamlFile:
    """Read YAML from a text; ``path`` names it in problems."""
    try:
        root, found = read_nodes(text)
    except Unreadable as error:
        return _unreadable(path, error.place, error.message)
    problems = (
        _join(_at(path, problem.place), problem.path, problem.message)
        for problem in sorted(found, key=lambda problem: problem.place)
    )
    return YamlFile(path, root.plain(), tuple(problems), root)


def _message(details: ErrorDetails) -> str:
    kind, context = details["type"], details.get("ctx", {})
    if kind == "missing":
        return "missing"
    if kind == "value_error":
        return str(context["error"])
    say = _MESSAGES.get(kind)
    expected = say(context) if say else details["msg"]
    return f"{shown(details['input'])}, {expected}"


def shown(value: object) -> str:
    """Show what came in a message: its repr, cut to 80 characters."""
    return repr(value)[:80]


def _step(node: Node, key: str | int) -> Node | None:
    """Go to what a key or an index names; None if it is not there."""
    if isinstance(node.value, dict):
        found = node.value.get(str(key))
        return found if isinstance(found, Node) else None
    if isinstance(node.value, list) and isinstance(key, int) and key < len(node.value):
        item = node.value[key]
        return item if isinstance(item, Node) else None
    return None


def _unreadable(path: Path, place: tuple[int, int], message: str) -> YamlFile:
    return YamlFile(
        path, None, (_join(_at(path, place), (), message),), Node(place, None)
    )


def _at(path: Path, place: tuple[int, int]) -> str:
    return f"{path}:{place[0]}:{place[1]}"


def _join(place: str, keys: Sequence[str | int], message: str) -> str:
    dotted = ".".join(str(key) for key in keys)
    return f"{place}: {dotted}: {message}" if dotted else f"{place}: {message}"
