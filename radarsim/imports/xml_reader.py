"""Read XML files as trees whose elements know their lines.

What a file declares of itself, such as entities, is refused: a few lines of it could
become gigabytes, or the content of other files.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final
from xml.parsers import expat

from radarsim.errors import ForeignFileError
from radarsim.imports.source_file import read_bytes, wrong

MAX_DEPTH: Final = 100
MAX_ELEMENTS: Final = 500_000


@dataclass(slots=True, eq=False)
class XmlElement:
    """An element.

    Attributes:
        tag: Its name.
        attributes: Its attributes.
        line: Where it begins.
        text: All text directly in it.
        children: The elements directly in it.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    text: str = ""
    children: list["XmlElement"] = field(default_factory=list)

    def all(self, tag: str) -> Iterator["XmlElement"]:
        """Yield the elements of a name directly in it."""
        return (child for child in self.children if child.tag == tag)

    def first(self, tag: str) -> "XmlElement | None":
        """Return the first element of a name directly in it, or None."""
        return next(self.all(tag), None)

    def text_of(self, tag: str) -> str:
        """Return the text of the first element of a name; empty if there is none."""
        found = self.first(tag)
        return found.text.strip() if found else ""

    @property
    def name(self) -> str:
        """Its attribute ``name``, or its tag."""
        return self.attributes.get("name") or self.tag


class _TreeBuilder:
    """Builds the tree of one file from what its parser tells."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.root: XmlElement | None = None
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.CharacterDataHandler = self.add_text
        self.parser.StartDoctypeDeclHandler = self.refuse
        self.parser.buffer_text = True
        self._open: list[XmlElement] = []
        self._count = 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        line = self.parser.CurrentLineNumber
        element = XmlElement(tag, attributes, line)
        self._count += 1
        if len(self._open) >= MAX_DEPTH or self._count > MAX_ELEMENTS:
            text = f"more than {MAX_DEPTH} levels or {MAX_ELEMENTS} elements"
            raise wrong(self.path, line, text)
        if self._open:
            self._open[-1].children.append(element)
        else:
            self.root = element
        self._open.append(element)

    def end(self, _: str) -> None:
        self._open.pop()

    def add_text(self, text: str) -> None:
        self._open[-1].text += text

    def refuse(self, *_: object) -> None:
        line = self.parser.CurrentLineNumber
        raise wrong(self.path, line, "a document type, expected none")


def is_xml(path: Path) -> bool:
    """Return whether a file begins as XML does, with a less-than sign.

    Raises:
        ForeignFileError: If it cannot be read, or is too large.
    """
    before = b"\xef\xbb\xbf\xff\xfe\0 \t\r\n"  # marks of encodings, and blanks
    return read_bytes(path).lstrip(before).startswith(b"<")


def read_xml(path: Path) -> XmlElement:
    """Read a file, and return its outermost element.

    Raises:
        ForeignFileError: If it cannot be read, is no XML, declares a document type, or
            is too large.
    """
    builder = _TreeBuilder(path)
    try:
        builder.parser.Parse(read_bytes(path), True)
    except expat.ExpatError as error:
        reason = expat.errors.messages[error.code]
        raise wrong(path, error.lineno, f"no XML: {reason}") from error
    except ValueError as error:  # an encoding that is not known
        raise wrong(path, 1, f"no XML: {error}") from error
    if builder.root is None:
        raise ForeignFileError(f"{path}:1: no XML")
    return builder.root
