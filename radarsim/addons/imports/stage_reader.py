"""Read world files of Stage as trees of entities.

Source: the manual of Stage 4, and the world files that come with it.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple

from radarsim.addons.imports.source_file import find_in, read_text
from radarsim.errors import ForeignFileError
from radarsim.validation import short_repr
from radarsim.xml_reader import place, wrong

MAX_DEPTH: Final = 50  # of entities in each other, and of definitions of definitions
MAX_ENTRIES: Final = 200_000  # entities and properties
MAX_FILES: Final = 100

_TOKEN: Final = re.compile(
    r"""\s+ | \#.*
    | "(?P<text>[^"]*)"
    | (?P<sign>[()\[\]])
    | (?P<word>[^\s()\[\]"\#]+ (?: \[\d+\] [^\s()\[\]"\#]*)*)""",
    re.VERBOSE,
)


class Property(NamedTuple):
    """A property of an entity.

    Attributes:
        values: Its words.
        path: The file that sets it.
        line: Where it does.
    """

    values: tuple[str, ...]
    path: Path
    line: int

    @property
    def text(self) -> str:
        """All its words."""
        return " ".join(self.values)


@dataclass(slots=True, eq=False)
class Entity:
    """An entity, such as a model.

    Attributes:
        kind: The word before its parenthesis.
        path: The file that has it.
        line: Where it begins.
        base: The definition of its kind; None if nothing defines this.
        depth: Number of definitions that it is based on.
        own: What it sets itself, by name; the last one counts.
        children: The entities in it, without those of its definition.
    """

    kind: str
    path: Path
    line: int
    base: "Entity | None" = None
    depth: int = 0
    own: dict[str, Property] = field(default_factory=dict)
    children: list["Entity"] = field(default_factory=list)

    @property
    def root_kind(self) -> str:
        """The kind that its definitions lead to."""
        return self.base.root_kind if self.base else self.kind

    def get(self, name: str) -> Property | None:
        """Return a property, its own or that of its definition."""
        found = self.own.get(name)
        return self.base.get(name) if found is None and self.base else found

    def all_children(self) -> Iterator["Entity"]:
        """Yield the entities in it, those of its definition first."""
        if self.base:
            yield from self.base.all_children()
        yield from self.children


class _Token(NamedTuple):
    """A sign, a word, or a text that was in quotes; its kind is the group's name."""

    kind: str
    value: str
    line: int


def read_stage(path: Path, folders: tuple[Path, ...], notes: list[str]) -> Entity:
    """Read a world file with the files that it includes.

    Args:
        path: The file.
        folders: Where included files are searched, beside its own folder.
        notes: Gets what is left out.

    Returns:
        An entity with all models of the world in it.

    Raises:
        ForeignFileError: If a file cannot be read, or is no world file.
    """
    world = Entity("world", path, 1)
    _WorldReader(world, (path.parent, *folders), notes).read(path, ())
    return world


class _WorldReader:
    """Reads files into one world."""

    def __init__(
        self, world: Entity, folders: tuple[Path, ...], notes: list[str]
    ) -> None:
        self._world = world
        self._folders = folders
        self._notes = notes
        self._definitions: dict[str, Entity] = {}
        self._entries = 0
        self._files = 0

    def read(self, path: Path, included_by: tuple[Path, ...]) -> None:
        """Read a file."""
        # Counted over all files: includes of includes could double at each level.
        self._files += 1
        if self._files > MAX_FILES:
            text = f"more than {MAX_FILES} files are included, expected fewer"
            raise ForeignFileError(f"{self._world.path}: {text}")
        tokens = _tokens(path)
        files = (*included_by, path.resolve())
        for token in tokens:
            if (token.kind, token.value) == ("word", "include"):
                name = _expect(path, tokens, token, "text")
                found = find_in(self._folders, name.value)
                named = short_repr(name.value)
                if found is None or not found.is_file():
                    text = f"the file {named} is left out: see --model-path"
                    self._notes.append(place(path, name.line, text))
                elif found in files:
                    raise wrong(path, name.line, f"{named} includes itself")
                else:
                    self.read(found, files)
            else:
                self._read_entry(path, tokens, token, self._world, 0)

    def _read_entry(
        self,
        path: Path,
        tokens: Iterator[_Token],
        token: _Token,
        to: Entity,
        depth: int,
    ) -> None:
        """Read a definition, an entity or a property."""
        self._entries += 1
        if depth > MAX_DEPTH or self._entries > MAX_ENTRIES:
            text = f"more than {MAX_DEPTH} levels or {MAX_ENTRIES} entries"
            raise wrong(path, token.line, text)
        if token.kind != "word":
            text = f"{short_repr(token.value)}, expected the name of a property"
            raise wrong(path, token.line, text)
        if token.value == "define":
            name = _expect(path, tokens, token, "word")
            kind = _expect(path, tokens, token, "word")
            _expect(path, tokens, kind, "(")
            # Known only after its end: it cannot be based on itself.
            definition = self._entity(path, kind)
            self._read_entity(path, tokens, definition, depth)
            self._definitions[name.value] = definition
            return
        first = next(tokens, None)
        if first is not None and first.value == "(" and first.kind == "sign":
            entity = self._entity(path, token)
            to.children.append(entity)
            self._read_entity(path, tokens, entity, depth)
        else:
            values = _read_values(path, tokens, token, first)
            to.own[token.value] = Property(values, path, token.line)

    def _entity(self, path: Path, kind: _Token) -> Entity:
        base = self._definitions.get(kind.value)
        depth = base.depth + 1 if base else 0
        if depth > MAX_DEPTH:
            text = f"more than {MAX_DEPTH} definitions that are based on each other"
            raise wrong(path, kind.line, text)
        return Entity(kind.value, path, kind.line, base, depth)

    def _read_entity(
        self, path: Path, tokens: Iterator[_Token], entity: Entity, depth: int
    ) -> None:
        """Read what is between parentheses."""
        for token in tokens:
            if token.kind == "sign" and token.value == ")":
                return
            self._read_entry(path, tokens, token, entity, depth + 1)
        text = f"{short_repr(entity.kind)} is not closed, expected ')'"
        raise wrong(path, entity.line, text)


def _tokens(path: Path) -> Iterator[_Token]:
    """Yield the tokens of a file."""
    for number, line in enumerate(read_text(path).split("\n"), 1):
        at = 0
        while at < len(line):
            match = _TOKEN.match(line, at)
            if match is None:
                raise wrong(path, number, "a quote that is not closed on its line")
            at = match.end()
            if match.lastgroup is not None:
                yield _Token(match.lastgroup, match[match.lastgroup], number)


def _expect(
    path: Path, tokens: Iterator[_Token], before: _Token, wanted: str
) -> _Token:
    """Return the next token, which has to be of a kind, or a sign."""
    found = next(tokens, None)
    if found is not None:
        got = found.value if found.kind == "sign" else found.kind
        if got == wanted:
            return found
    expected = {"text": "a file name in quotes", "word": "a word"}.get(wanted, "'('")
    text = f"{short_repr(before.value)} without what follows, expected {expected}"
    raise wrong(path, before.line, text)


def _read_values(
    path: Path, tokens: Iterator[_Token], name: _Token, first: _Token | None
) -> tuple[str, ...]:
    """Return the words of a property, which are one, or several in brackets."""
    if first is not None and first.kind != "sign":
        return (first.value,)
    values = []
    if first is not None and first.value == "[":
        for token in tokens:
            if token.kind != "sign":
                values.append(token.value)
            elif token.value == "]":
                return tuple(values)
            else:
                break
    text = f"{short_repr(name.value)}, expected a value, '[...]' or '(...)' after it"
    raise wrong(path, name.line, text)
