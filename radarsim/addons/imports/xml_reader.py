"""XML of other programs: trees whose elements know their lines.

What a file declares of itself, such as entities, is refused: a few lines of it could
become gigabytes, or the content of other files.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final
from xml.parsers import expat

from radarsim.errors import ForeignFileError, describe_os_error
from radarsim.validation import short_repr

_DECLARED: Final = re.compile(rb"""<\?xml[^>]*?encoding\s*=\s*["']([\w.-]+)""")
MAX_TEXT_BYTES: Final = 16 * 2**20
MAX_DEPTH: Final = 100
MAX_ELEMENTS: Final = 500_000


def wrong(path: Path, line: int, text: str) -> ForeignFileError:
    """Return the error of a place in a file."""
    return ForeignFileError(place(path, line, text))


def place(path: Path, line: int, text: str) -> str:
    """Return a text about a line of a file."""
    return f"{path}:{line}: {text}"


def read_bytes(path: Path, most: int = MAX_TEXT_BYTES) -> bytes:
    """Read a file.

    Raises:
        ForeignFileError: If it cannot be read, or is too large.
    """
    try:
        with path.open("rb") as file:
            # One byte more tells that there are too many, also of a device that has no
            # size.
            content = file.read(most + 1)
    except OSError as error:
        raise ForeignFileError(f"{path}: {describe_os_error(error)}") from error
    if len(content) > most:
        raise ForeignFileError(f"{path}: expected at most {most} bytes")
    return content


def parse_numbers(path: Path, line: int, text: str, count: int) -> list[float]:
    """Parse numbers with white space between them.

    Raises:
        ForeignFileError: If there are not so many finite ones.
    """
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        plural = "a number" if count == 1 else f"{count} numbers"
        raise wrong(path, line, f"{short_repr(text.strip())}, expected {plural}")
    return numbers


@dataclass(slots=True, eq=False)
class XmlElement:
    """An element.

    Attributes:
        tag: Its name.
        attributes: Its attributes.
        path: The file that has it.
        line: Where it begins.
        text: All text directly in it.
        children: The elements directly in it.
    """

    tag: str
    attributes: dict[str, str]
    path: Path
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

    def size(self) -> int:
        """Return the number of elements in it, itself included."""
        return 1 + sum(child.size() for child in self.children)

    @property
    def name(self) -> str:
        """Its attribute ``name``, or its tag."""
        return self.attributes.get("name") or self.tag


def read_xml(path: Path) -> XmlElement:
    """Read a file, and return its outermost element.

    Text that is not in the encoding that the file declares, UTF-8 by default, is taken
    for Latin-1.

    Raises:
        ForeignFileError: If it cannot be read, is no XML, declares a document type, or
            is too large.
    """
    content = read_bytes(path)
    parser = expat.ParserCreate(_encoding(content))
    root: XmlElement | None = None
    open_: list[XmlElement] = []
    count = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal root, count
        element = XmlElement(tag, attributes, path, parser.CurrentLineNumber)
        count += 1
        if len(open_) >= MAX_DEPTH or count > MAX_ELEMENTS:
            text = f"more than {MAX_DEPTH} levels or {MAX_ELEMENTS} elements"
            raise wrong(path, element.line, text)
        if open_:
            open_[-1].children.append(element)
        else:
            root = element
        open_.append(element)

    def end(_: str) -> None:
        open_.pop()

    def add_text(text: str) -> None:
        open_[-1].text += text

    def refuse(*_: object) -> None:
        # Entities, which a document type declares, could become gigabytes.
        raise wrong(path, parser.CurrentLineNumber, "a document type, expected none")

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = add_text
    parser.StartDoctypeDeclHandler = refuse
    # Else expat calls for each line of a text, which is added to slowly.
    parser.buffer_text = True
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        reason = expat.errors.messages[error.code]
        raise wrong(path, error.lineno, f"no XML: {reason}") from error
    except ValueError as error:  # an encoding that is not known
        raise wrong(path, 1, f"no XML: {error}") from error
    if root is None:
        raise ForeignFileError(f"{path}:1: no XML")
    return root


def _encoding(content: bytes) -> str | None:
    """Return the encoding of a file that is in another one than it says, or None."""
    declared = _DECLARED.match(content)
    is_utf_8 = declared is None or declared[1].lower() == b"utf-8"
    if content.startswith((b"\xff\xfe", b"\xfe\xff", b"<\0")) or not is_utf_8:
        return None
    try:
        content.decode()
    except UnicodeDecodeError:
        return "iso-8859-1"
    return None
