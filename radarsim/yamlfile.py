"""YAML files: plain data, and the place of everything in it, for error messages.

Whatever is wrong is said as ``file:line:column: key.path: message``, whether the
text is no YAML or a model refuses the data; see yamlnodes.py for what is no YAML here.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from radarsim.yamlnodes import Node, Unreadable, read_nodes

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

    def refusals(
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
