"""Finds files of other programs, and reads their bytes, text and XML.

XML with a document type is refused, as its entities could expand to gigabytes, or
include the content of other files.
"""

import math
import re
from collections.abc import Iterable, Iterator
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
    """Return an error whose message names a file and a line."""
    return ForeignFileError(place(path, line, text))


def place(path: Path, line: int, text: str) -> str:
    """Return a message that begins with the path of a file and a line number."""
    return f"{path}:{line}: {text}"


def read_bytes(path: Path, most: int = MAX_TEXT_BYTES) -> bytes:
    """Read the bytes of a file of limited size.

    Raises:
        ForeignFileError: If the file cannot be read, or is too large.
    """
    try:
        with path.open("rb") as file:
            # One byte more than allowed is read, to detect files that are too large,
            # even devices.
            content = file.read(most + 1)
    except OSError as error:
        raise ForeignFileError(f"{path}: {describe_os_error(error)}") from error
    if len(content) > most:
        raise ForeignFileError(f"{path}: too large, expected at most {most} bytes")
    return content


def read_text(path: Path) -> str:
    """Read a text file, and convert its line ends to line feeds.

    The encoding is UTF-16 if the file starts with its byte order mark, else UTF-8, or
    Latin-1 if the file is not valid UTF-8.

    Raises:
        ForeignFileError: If the file cannot be read, is too large, or is no text.
    """
    content = read_bytes(path)
    is_utf_16 = content.startswith((b"\xff\xfe", b"\xfe\xff"))
    try:
        text = content.decode("utf-16" if is_utf_16 else "utf-8-sig")
    except UnicodeDecodeError as error:
        if is_utf_16 or b"\0" in content:
            expected = "expected UTF-8, UTF-16 or Latin-1"
            raise wrong(path, 1, f"bytes that are not text, {expected}") from error
        text = content.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def find_in(folders: Iterable[Path], reference: str) -> Path | None:
    """Find a file or folder by a relative path in some folders, and resolve links.

    Args:
        folders: Folders to search, in order.
        reference: A path relative to the folders.

    Returns:
        The first match; None if there is no match inside one of the folders.
    """
    for folder in folders:
        inside = folder.resolve()
        try:
            path = (inside / reference).resolve()
            if path.is_relative_to(inside) and path.exists():
                return path
        except (OSError, RuntimeError, ValueError):  # long path, link loop, or NUL
            continue
    return None


def rounded(numbers: Iterable[float]) -> list[float]:
    """Round numbers to five decimals for map files, which is 0.01 mm for lengths."""
    return [round(float(number), 5) + 0.0 for number in numbers]


@dataclass(slots=True, eq=False)
class XmlElement:
    """An XML element with its line in the file.

    Attributes:
        tag: Name of the element.
        attributes: Attributes of the element.
        path: File that contains the element.
        line: Line on which the element starts.
        text: Text directly in the element.
        children: Child elements.
    """

    tag: str
    attributes: dict[str, str]
    path: Path
    line: int
    text: str = ""
    children: list["XmlElement"] = field(default_factory=list)

    def all(self, tag: str) -> Iterator["XmlElement"]:
        """Yield the child elements with this name."""
        return (child for child in self.children if child.tag == tag)

    def first(self, tag: str) -> "XmlElement | None":
        """Return the first child element with this name, or None."""
        return next(self.all(tag), None)

    def text_of(self, tag: str) -> str:
        """Return the text of the first child element with this name, or ``""``."""
        found = self.first(tag)
        return found.text.strip() if found else ""

    def size(self) -> int:
        """Return the number of elements in this element, including itself."""
        return 1 + sum(child.size() for child in self.children)

    @property
    def name(self) -> str:
        """The attribute ``name``, or the tag if there is none."""
        return self.attributes.get("name") or self.tag

    def wrong(self, text: str) -> ForeignFileError:
        """Return an error whose message names the file and line of this element."""
        return wrong(self.path, self.line, text)

    def numbers(self, count: int) -> list[float]:
        """Parse the element's text as numbers that are separated by white space.

        Raises:
            ForeignFileError: If the text is not ``count`` finite numbers.
        """
        try:
            numbers = [float(word) for word in self.text.split()]
        except ValueError:
            numbers = []
        if len(numbers) != count or not all(map(math.isfinite, numbers)):
            plural = "a number" if count == 1 else f"{count} numbers"
            raise self.wrong(f"{short_repr(self.text.strip())}, expected {plural}")
        return numbers


def read_xml(path: Path) -> XmlElement:
    """Read an XML file, and return its root element.

    A file that is not valid in its declared encoding, UTF-8 by default, is read as
    Latin-1.

    Raises:
        ForeignFileError: If the file cannot be read, is no XML, declares a document
            type, or is too large.
    """
    content = read_bytes(path)
    parser = expat.ParserCreate(_encoding(content))
    open_ = [XmlElement("", {}, path, 0)]  # the file, then the elements that are open
    count = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        element = XmlElement(tag, attributes, path, parser.CurrentLineNumber)
        count += 1
        if len(open_) > MAX_DEPTH or count > MAX_ELEMENTS:
            text = f"more than {MAX_DEPTH} levels, or {MAX_ELEMENTS} elements"
            raise wrong(path, element.line, text)
        open_[-1].children.append(element)
        open_.append(element)

    def add_text(text: str) -> None:
        open_[-1].text += text

    def refuse(*_: object) -> None:
        # A document type can declare entities, which could expand to gigabytes.
        raise wrong(path, parser.CurrentLineNumber, "a DOCTYPE, expected none")

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: open_.pop()
    parser.CharacterDataHandler = add_text
    parser.StartDoctypeDeclHandler = refuse
    # Without a buffer, expat calls ``add_text`` for each line, which is slow.
    parser.buffer_text = True
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        reason = expat.errors.messages[error.code]
        raise wrong(path, error.lineno, f"not XML: {reason}") from error
    except ValueError as error:  # unknown encoding
        raise wrong(path, 1, f"not XML: {error}") from error
    return open_[0].children[0]


def _encoding(content: bytes) -> str | None:
    """Return Latin-1 for a file that should be UTF-8 but is not, otherwise None."""
    declared = _DECLARED.match(content)
    is_utf_8 = declared is None or declared[1].lower() == b"utf-8"
    if content.startswith((b"\xff\xfe", b"\xfe\xff", b"<\0")) or not is_utf_8:
        return None
    try:
        content.decode()
    except UnicodeDecodeError:
        return "iso-8859-1"
    return None
