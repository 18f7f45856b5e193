"""Reads YAML files as plain data, with the position of each value for error messages.

Every problem is reported as ``file:line:column: key.path: message``, whether the text
is not valid YAML or a pydantic model rejects the data.

Files are YAML 1.2 with the core schema: ``1e-3`` is a number, ``on`` and ``12:30`` are
text. Keys are text. Tags, duplicate keys, numbers that are not finite, and aliases that
expand to more than ``MAX_VALUES`` values are refused.
"""

# libyaml parses the text and composes nodes: 1 s of CPU time for a map of 40,000
# objects, compared with a minute for parsers in Python. This module converts scalars
# and keys itself, since PyYAML resolves scalars by YAML 1.1 and accepts duplicate keys.

import gc
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from pydantic import ValidationError
from pydantic_core import ErrorDetails
from yaml import Mark, MarkedYAMLError, Node
from yaml.composer import ComposerError
from yaml.cyaml import CParser
from yaml.nodes import MappingNode, ScalarNode, SequenceNode

from radarsim.validation import describe_invalid, describe_unknown_key, short_repr

KeyPath: TypeAlias = tuple[str | int, ...]
Position: TypeAlias = tuple[int, int]  # line and column, from 1
# A problem after which reading continues, as position, key path and message.
YamlProblem: TypeAlias = tuple[Position, KeyPath, str]

MAX_BYTES = 1024 * 1024
MAX_VALUES = 500_000  # values in a file, with aliases expanded
MAX_KEY = 80  # characters of a key in a message
MAX_DEPTH = 32  # levels of nested lists and dicts, also within keys
_TOO_DEEP = f"more than {MAX_DEPTH} levels of nesting"

_INTEGER = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_STARTS_OF_NUMBERS = frozenset("+-.0123456789")
# Characters that YAML 1.2 excludes. They are searched before parsing, since libyaml
# reports positions in bytes, not in characters.
_NOT_ALLOWED = re.compile(
    r"[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
)
_CONSTANTS: dict[str, bool | None] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}


class UnreadableYaml(Exception):
    """A YAML text cannot be parsed beyond a certain position."""

    def __init__(self, position: Position, message: str) -> None:
        super().__init__(message)
        self.position = position
        self.message = message


@dataclass(frozen=True)
class YamlFile:
    """The content of one YAML file.

    Attributes:
        path: The path as given by the caller; messages begin with it.
        data: Dicts with text as keys, lists, text, numbers, booleans and None; None
            if the file is not YAML.
        problems: Problems of the YAML syntax, sorted by position.
    """

    path: Path
    data: object
    problems: tuple[str, ...]
    _root: Node

    def place(self, keys: Sequence[str | int], *, of_key: bool = False) -> str:
        """Return the place of a value as ``file:line:column``.

        If there is no such value, the position of the innermost existing value is used.

        Args:
            keys: Keys and list indices, outermost first.
            of_key: Whether to return the position of the last key, not of its value.
        """
        node = marked = self._root
        for key in keys:
            pairs: Iterable[tuple[Node, Node]] = ()
            if isinstance(node, MappingNode):
                pairs = (pair for pair in node.value if pair[0].value == str(key))
            elif isinstance(node, SequenceNode) and isinstance(key, int):
                pairs = ((item, item) for item in node.value[key : key + 1])
            found = next(iter(pairs), None)
            if found is None:
                marked = node
                break
            marked, node = found[not of_key], found[1]
        return _place(self.path, _position(marked))

    def problem(
        self, keys: Sequence[str | int], message: str, *, of_key: bool = False
    ) -> str:
        """Return the text of a problem: ``file:line:column: key.path: message``."""
        return _format_problem(self.place(keys, of_key=of_key), keys, message)

    def validation_problems(
        self,
        error: ValidationError,
        at: Sequence[str | int] = (),
        *,
        known: Iterable[str] = (),
        most: int | None = None,
    ) -> list[str]:
        """Return the texts of the errors that a pydantic model found in the file.

        Args:
            error: The exception that the model raised.
            at: Key path of the data that the model validated.
            known: The keys of the model, for messages about unknown keys.
            most: Maximum number of errors; None for all.
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
    """Read a YAML file as plain data.

    Raises:
        OSError: If the file cannot be read.
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
        return _unreadable(path, position, "bytes that are not text, expected UTF-8")


def parse_yaml(path: Path, text: str) -> YamlFile:
    """Parse YAML text; ``path`` is the file name in messages."""
    try:
        data, root, found = compose(text)
    except UnreadableYaml as error:
        return _unreadable(path, error.position, error.message)
    problems = (
        _format_problem(_place(path, position), keys, message)
        for position, keys, message in sorted(found, key=lambda problem: problem[0])
    )
    return YamlFile(path, data, tuple(problems), root)


def parse_plain(text: str) -> object:
    """Parse YAML text whose positions are not needed; numbers may be infinite.

    Raises:
        ValueError: If there is any problem.
    """
    try:
        data, _, problems = compose(text, finite=False)
    except UnreadableYaml as error:
        raise ValueError(error.message) from error
    if problems:
        raise ValueError(problems[0][2])
    return data


def compose(
    text: str, *, finite: bool = True
) -> tuple[object, Node, list[YamlProblem]]:
    """Read a text with a single YAML document.

    Args:
        text: The text.
        finite: Whether infinite numbers and NaN are problems.

    Returns:
        The data, the root node, and all problems after which reading can continue.

    Raises:
        UnreadableYaml: At the first problem after which reading cannot continue.
    """
    if wrong := _NOT_ALLOWED.search(text):
        message = f"not YAML: character {wrong[0]!r}"
        raise UnreadableYaml(_position_at(text, wrong.start()), message)
    reader, collects = _Reader(finite=finite), gc.isenabled()
    gc.disable()  # The garbage collector would scan all nodes many times.
    try:
        root = _Parser(text).get_single_node() or _node_at((1, 1))
        data = reader.read(root, ())
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        position = (mark.line + 1, mark.column + 1) if mark else (1, 1)
        # For a truncated text, libyaml may report a position after the end of the text.
        position = min(position, _position_at(text, len(text)))
        reason = error.problem or error.context
        if isinstance(error, ComposerError):
            reason = ", ".join(filter(None, (error.context, error.problem)))
        if mark and text[mark.index : mark.index + 1] == "\t":
            reason = "a tab, expected spaces"  # libyaml does not always report tabs
        message = f"not YAML: {reason}"
        raise UnreadableYaml(position, message) from error
    finally:
        if collects:
            gc.enable()
    found = [(place, keys, text) for (place, text), keys in reader.problems.items()]
    return data, root, found


def _position_at(text: str, index: int) -> Position:
    before = text[:index]
    return before.count("\n") + 1, index - before.rfind("\n")


class _Parser(CParser):  # type: ignore[misc]
    """Composes YAML nodes without type tags, and limits the depth of nesting."""

    _depth = 0

    def descend_resolver(self, parent: Node | None, _: object) -> None:
        self._depth += 1
        if parent is not None and self._depth > MAX_DEPTH + 1:
            raise UnreadableYaml(_position(parent), _TOO_DEEP)

    def ascend_resolver(self) -> None:
        self._depth -= 1

    def resolve(self, *_: object) -> None:
        return None


class _Reader:
    """Converts YAML nodes to plain data.

    Attributes:
        problems: The key path of each problem, by position and message.
    """

    def __init__(self, *, finite: bool) -> None:
        self.problems: dict[tuple[Position, str], KeyPath] = {}
        self._finite = finite
        self._values = 0

    def read(self, node: Node, keys: KeyPath) -> object:
        """Return the data of a node, with limits on the size of expanded aliases."""
        self._values += 1
        if self._values > MAX_VALUES:
            raise UnreadableYaml(_position(node), f"more than {MAX_VALUES} values")
        if len(keys) > MAX_DEPTH:
            raise UnreadableYaml(_position(node), _TOO_DEEP)
        if node.tag is not None:
            self._report(node, keys, f"tag {short_repr(node.tag)}, expected none")
        if isinstance(node, ScalarNode):
            return self._scalar(node, keys)
        if isinstance(node, SequenceNode):
            return [self.read(item, (*keys, i)) for i, item in enumerate(node.value)]
        values: dict[str, object] = {}
        lines: dict[str, int] = {}
        for key_node, value_node in node.value:
            key = self._key(key_node, keys)
            value = self.read(value_node, (*keys, key))
            if key in values:
                first = f"first in line {lines[key]}"
                self._report(key_node, (*keys, key), f"duplicate key, {first}")
            else:
                values[key], (lines[key], _) = value, _position(key_node)
        return values

    def _key(self, node: Node, keys: KeyPath) -> str:
        if isinstance(node, ScalarNode) and node.tag is None:
            return str(node.value)
        self.read(node, (*keys, "?"))  # to report problems inside the key
        self._report(node, keys, "a key that is not text, expected a name")
        return ""

    def _scalar(self, node: ScalarNode, keys: KeyPath) -> str | float | bool | None:
        text: str = node.value
        is_quoted = bool(node.style)  # quoted, or a block scalar
        if not is_quoted and text in _CONSTANTS:
            return _CONSTANTS[text]
        # This check of the first character spares most texts the slow regular
        # expressions.
        if is_quoted or text[0] not in _STARTS_OF_NUMBERS:
            return text
        if _INTEGER.fullmatch(text):
            if len(text) <= 300:
                return int(text, 0) if text[:2] in ("0o", "0x") else int(text)
            value = math.inf  # since converting millions of digits is slow
        elif _FLOAT.fullmatch(text):
            value = float(text)
        elif _NOT_FINITE.fullmatch(text):
            value = float(text.replace(".", ""))
        else:
            return text
        if self._finite and not math.isfinite(value):
            message = f"{short_repr(text)}, expected a finite number"
            self._report(node, keys, message)
            return 1.0  # a value that causes no further problems
        return value

    def _report(self, node: Node, keys: KeyPath, message: str) -> None:
        # The same problem of a node is reported once, even if several aliases refer to
        # the node.
        self.problems.setdefault((_position(node), message), keys)


def _position(node: Node) -> Position:
    mark = node.start_mark
    return mark.line + 1, mark.column + 1


def _node_at(position: Position) -> Node:
    line, column = position
    mark = Mark("", 0, line - 1, column - 1, None, 0)
    return ScalarNode(None, "", mark, mark)


def _unreadable(path: Path, position: Position, message: str) -> YamlFile:
    problem = _format_problem(_place(path, position), (), message)
    return YamlFile(path, None, (problem,), _node_at(position))


def _place(path: Path, position: Position) -> str:
    line, column = position
    return f"{path}:{line}:{column}"


def _format_problem(place: str, keys: Sequence[str | int], message: str) -> str:
    dotted = ".".join(str(key)[:MAX_KEY] for key in keys)
    return f"{place}: {dotted}: {message}" if dotted else f"{place}: {message}"
