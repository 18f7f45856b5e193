"""Read YAML files as plain data, with the position of every value for error messages.

Every problem is reported as ``file:line:column: key.path: message``, whether the text
is not valid YAML or a pydantic model rejects the data.

YAML 1.2 with the core schema: ``1e-3`` is a number, ``on`` and ``12:30`` are text. Keys
are text. Tags, duplicate keys, numbers that are not finite, and aliases that multiply
into more values than any hand-written file contains are refused.
"""

# libyaml parses, and nodes are composed here from its events: a map of 40,000 objects
# takes 2 s of CPU time, where pure Python parsers took a minute. Loaders that compose
# nodes or data themselves resolve scalars by YAML 1.1, and keep the last of duplicate
# keys without a word.

import math
import re
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from pydantic import ValidationError
from pydantic_core import ErrorDetails
from yaml import MarkedYAMLError
from yaml.cyaml import CParser
from yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    Event,
    MappingEndEvent,
    MappingStartEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)

from radarsim.validation import describe_invalid, describe_unknown_key, short_repr

KeyPath: TypeAlias = tuple[str | int, ...]
Position: TypeAlias = tuple[int, int]  # line and column, from 1
# Of the text, which does not keep the rest from being read: where, and a message.
YamlProblem: TypeAlias = tuple[Position, KeyPath, str]
_ValueEvent: TypeAlias = (
    AliasEvent | ScalarEvent | SequenceStartEvent | MappingStartEvent
)

MAX_BYTES = 1024 * 1024
MAX_VALUES = 500_000  # with aliases expanded
MAX_KEY = 80  # characters of a key in a problem
MAX_DEPTH = 32  # of nested lists and dicts, including those used as keys

_INTEGER = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_STARTS_OF_NUMBERS = frozenset("+-.0123456789")
# Characters that YAML 1.2 excludes; libyaml counts bytes before them, not characters.
_NOT_ALLOWED = re.compile(
    r"[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
)
_CONSTANTS: dict[str, bool | None] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}


@dataclass(slots=True, eq=False)
class Node:
    """A value and its position.

    Attributes:
        position: Line and column of the value.
        value: A scalar, a list of nodes, or a dict of nodes.
        key_positions: Positions of the keys of a dict; None for anything else.
        size: Number of values in it, itself included.
        depth: Number of levels below it, 0 for a scalar.
    """

    position: Position
    value: "dict[str, Node] | list[Node] | str | float | bool | None"
    key_positions: dict[str, Position] | None = None
    size: int = 1
    depth: int = 0

    def to_plain(self) -> object:
        """Return the value without positions."""
        if isinstance(self.value, dict):
            return {key: node.to_plain() for key, node in self.value.items()}
        if isinstance(self.value, list):
            return [node.to_plain() for node in self.value]
        return self.value


class UnreadableYaml(Exception):
    """Nothing after a position can be read."""

    def __init__(self, position: Position, message: str) -> None:
        super().__init__(message)
        self.position = position
        self.message = message


@dataclass(frozen=True)
class YamlFile:
    """The content of one YAML file.

    Attributes:
        path: The path as it was given; problems begin with it.
        data: Dicts with text as keys, lists, text, numbers, booleans and None; None
            if the file is not YAML.
        problems: Problems with the file as YAML, sorted by position.
    """

    path: Path
    data: object
    problems: tuple[str, ...]
    _root: Node

    def place(self, keys: Sequence[str | int], *, of_key: bool = False) -> str:
        """Return ``file:line:column`` of a value, or of the innermost one around it.

        Args:
            keys: Keys and list indices from the outside in.
            of_key: Point at the last key instead of at its value.
        """
        node, position = self._root, self._root.position
        for key in keys:
            child = None
            if isinstance(node.value, dict):
                child = node.value.get(str(key))
            elif isinstance(node.value, list) and isinstance(key, int):
                child = node.value[key] if key < len(node.value) else None
            if child is None:
                position = node.position
                break
            positions = node.key_positions if of_key else None
            position = positions[str(key)] if positions else child.position
            node = child
        return _place(self.path, position)

    def problem(
        self, keys: Sequence[str | int], message: str, *, of_key: bool = False
    ) -> str:
        """Format a problem: ``file:line:column: key.path: message``."""
        return _format_problem(self.place(keys, of_key=of_key), keys, message)

    def validation_problems(
        self,
        error: ValidationError,
        at: Sequence[str | int] = (),
        *,
        known: Iterable[str] = (),
        most: int | None = None,
    ) -> list[str]:
        """Format the errors of a pydantic model.

        Args:
            error: The exception that the model raised.
            at: Key path of the data that the model validated.
            known: The model's own keys, for the message about an unknown one.
            most: How many to format; None for all.
        """
        keys, errors = sorted(known), error.errors()[:most]
        return [self._validation_problem(each, at, keys) for each in errors]

    def _validation_problem(
        self, details: ErrorDetails, at: Sequence[str | int], known: list[str]
    ) -> str:
        keys = [key for key in details["loc"] if key != "[key]"]
        unknown = details["type"] == "extra_forbidden"
        if unknown:
            message = "unknown key"
            if known and len(keys) == 1:
                message = describe_unknown_key(str(keys[0]), known)
        else:
            message = describe_invalid(details)
        return self.problem((*at, *keys), message, of_key=unknown)


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
        position = (before.count(b"\n") + 1, error.start - before.rfind(b"\n"))
        return _unreadable(path, position, "bytes that are no text, expected UTF-8")


def parse_yaml(path: Path, text: str) -> YamlFile:
    """Parse YAML text; ``path`` names it in problems."""
    try:
        root, found = compose(text)
    except UnreadableYaml as error:
        return _unreadable(path, error.position, error.message)
    problems = (
        _format_problem(_place(path, position), keys, message)
        for position, keys, message in sorted(found, key=lambda problem: problem[0])
    )
    return YamlFile(path, root.to_plain(), tuple(problems), root)


def parse_plain(text: str) -> object:
    """Parse YAML text of which no positions are needed; numbers may be infinite.

    Raises:
        ValueError: If there is any problem.
    """
    try:
        root, problems = compose(text, finite=False)
    except UnreadableYaml as error:
        raise ValueError(error.message) from error
    if problems:
        raise ValueError(problems[0][2])
    return root.to_plain()


def compose(text: str, *, finite: bool = True) -> tuple[Node, list[YamlProblem]]:
    """Compose the nodes of the one document in a text.

    Args:
        text: The text.
        finite: Whether infinite numbers, and what is no number, are problems.

    Returns:
        The root, and all problems after which reading can continue.

    Raises:
        UnreadableYaml: At the first problem after which it cannot.
    """
    if wrong := _NOT_ALLOWED.search(text):
        message = f"not YAML: character {wrong[0]!r}"
        raise UnreadableYaml(_position_at(text, wrong.start()), message)
    composer = _Composer(CParser(text).get_event, finite=finite)
    try:
        return composer.compose(), composer.problems
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        position = (mark.line + 1, mark.column + 1) if mark else (1, 1)
        # libyaml may point behind the end of a text that breaks off
        position = min(position, _position_at(text, len(text)))
        reason = error.problem or error.context
        if mark and text[mark.index : mark.index + 1] == "\t":
            reason = "a tab, expected blanks"  # libyaml does not always name it
        message = f"not YAML: {reason}"
        raise UnreadableYaml(position, message) from error


def _position_at(text: str, index: int) -> Position:
    before = text[:index]
    return before.count("\n") + 1, index - before.rfind("\n")


class _Composer:
    """Composes nodes from the events of a YAML stream and collects problems."""

    def __init__(self, next_event: Callable[[], Any], *, finite: bool) -> None:
        self.problems: list[YamlProblem] = []
        self._next = next_event
        self._finite = finite
        self._keys: list[str | int] = []  # of the node that is being composed
        self._anchors: dict[str, Node] = {}
        self._values = 0

    def compose(self) -> Node:
        """Read to the end of the stream."""
        root: Node | None = None
        while (event := self._next()) is not None:
            if isinstance(event, DocumentStartEvent) and root is not None:
                raise UnreadableYaml(
                    _position(event), "a second document, expected one"
                )
            if isinstance(event, _ValueEvent):
                root = self._node(event)
        return root or Node((1, 1), None)

    def _node(self, event: _ValueEvent) -> Node:
        if isinstance(event, AliasEvent):
            node = self._anchors.get(event.anchor)
            if node is None:  # missing, or the alias is inside of what it names
                name = short_repr(event.anchor)
                self._report(event, f"alias {name}, expected an anchor before it")
                return Node(_position(event), None)
            # with all that it stands for: a few lines may expand to gigabytes
            self._count(event, node.size, len(self._keys) + node.depth)
            return node
        self._count(event, 1, len(self._keys))
        if event.tag is not None:
            self._report(event, f"tag {short_repr(event.tag)}, expected none")
        if isinstance(event, ScalarEvent):
            node = Node(_position(event), self._scalar(event))
        elif isinstance(event, SequenceStartEvent):
            node = self._sequence(event)
        else:
            node = self._mapping(event)
        if event.anchor is not None:
            self._anchors[event.anchor] = node
        return node

    def _sequence(self, event: Event) -> Node:
        items: list[Node] = []
        while type(item := self._next()) is not SequenceEndEvent:
            self._keys.append(len(items))
            items.append(self._node(item))
            self._keys.pop()
        return Node(_position(event), items, None, *_size_and_depth(items))

    def _mapping(self, event: Event) -> Node:
        values: dict[str, Node] = {}
        positions: dict[str, Position] = {}
        while type(item := self._next()) is not MappingEndEvent:
            key = self._key(item)
            self._keys.append(key)
            value = self._node(self._next())
            if key in values:
                first = f"first in line {positions[key][0]}"
                self._report(item, f"duplicate key, {first}")
            else:
                values[key], positions[key] = value, _position(item)
            self._keys.pop()
        totals = _size_and_depth(values.values())
        return Node(_position(event), values, positions, *totals)

    def _key(self, event: _ValueEvent) -> str:
        if isinstance(event, ScalarEvent) and event.tag is None:
            return str(event.value)
        self._keys.append("?")
        self._node(event)  # reads to its end, and reports its problems
        self._keys.pop()
        self._report(event, "a key that is no plain text, expected a name")
        return ""

    def _scalar(self, event: ScalarEvent) -> str | float | bool | None:
        text: str = event.value
        is_quoted = bool(event.style)  # or a block of text
        if not is_quoted and text in _CONSTANTS:
            return _CONSTANTS[text]
        # The first character spares nearly all texts of a map the regular
        # expressions.
        if is_quoted or text[0] not in _STARTS_OF_NUMBERS:
            return text
        if _INTEGER.fullmatch(text):
            if len(text) <= 300:
                return int(text, 0) if text[:2] in ("0o", "0x") else int(text)
            value = math.inf  # to convert millions of digits takes long
        elif _FLOAT.fullmatch(text):
            value = float(text)
        elif _NOT_FINITE.fullmatch(text):
            value = float(text.replace(".", ""))
        else:
            return text
        if self._finite and not math.isfinite(value):
            self._report(event, f"{short_repr(text)}, expected a finite number")
            return 1.0  # a value that causes no further problems
        return value

    def _count(self, event: Event, values: int, depth: int) -> None:
        self._values += values
        if self._values > MAX_VALUES:
            raise UnreadableYaml(_position(event), f"more than {MAX_VALUES} values")
        if depth > MAX_DEPTH:
            raise UnreadableYaml(_position(event), f"more than {MAX_DEPTH} levels")

    def _report(self, event: Event, message: str) -> None:
        self.problems.append((_position(event), tuple(self._keys), message))


def _size_and_depth(nodes: Collection[Node]) -> tuple[int, int]:
    """Return the size and the depth of a list or dict of these nodes."""
    size, depth = 1, 0
    for node in nodes:
        size += node.size
        depth = max(depth, node.depth)
    return size, depth + 1


def _position(event: Event) -> Position:
    mark = event.start_mark
    return mark.line + 1, mark.column + 1


def _unreadable(path: Path, position: Position, message: str) -> YamlFile:
    problem = _format_problem(_place(path, position), (), message)
    return YamlFile(path, None, (problem,), Node(position, None))


def _place(path: Path, position: Position) -> str:
    line, column = position
    return f"{path}:{line}:{column}"


def _format_problem(place: str, keys: Sequence[str | int], message: str) -> str:
    dotted = ".".join(str(key)[:MAX_KEY] for key in keys)
    return f"{place}: {dotted}: {message}" if dotted else f"{place}: {message}"
