"""Files of other programs: where they may be, their bytes, text and XML.

What XML declares of itself, such as entities, is refused: a few lines of it could
become gigabytes, or the content of other files.
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
            # One byte more shows that there are too many, also of a device.
            content = file.read(most + 1)
    except OSError as error:
        raise ForeignFileError(f"{path}: {describe_os_error(error)}") from error
    if len(content) > most:
        raise ForeignFileError(f"{path}: expected at most {most} bytes")
    return content


def read_text(path: Path) -> str:
    """Read a file of text; line ends become line feeds.

    It is UTF-16 if it begins with a byte order mark of that, else UTF-8, or Latin-1 if
    it is not valid UTF-8.

    Raises:
        ForeignFileError: If it cannot be read, is too large, or is no text.
    """
    content = read_bytes(path)
    is_utf_16 = content.startswith((b"\xff\xfe", b"\xfe\xff"))
    try:
        text = content.decode("utf-16" if is_utf_16 else "utf-8-sig")
    except UnicodeDecodeError as error:
        if is_utf_16 or b"\0" in content:
            expected = "expected UTF-8, UTF-16 or Latin-1"
            raise wrong(path, 1, f"bytes that are no text, {expected}") from error
        text = content.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def find_in(folders: Iterable[Path], reference: str) -> Path | None:
    """Return the first file or folder of a name in folders, links resolved.

    Args:
        folders: Where it may be, or below.
        reference: A path relative to them.

    Returns:
        None if there is none, or if it would lead out of them.
    """
    for folder in folders:
        inside = folder.resolve()
        try:
            path = (inside / reference).resolve()
            if path.is_relative_to(inside) and path.exists():
                return path
        except (OSError, RuntimeError, ValueError):  # too long, loops, or with NUL
            continue
    return None


def rounded(numbers: Iterable[float]) -> list[float]:
    """Return numbers as they are written, to a hundredth of a millimetre."""
    return [round(float(number), 5) + 0.0 for number in numbers]


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

    def wrong(self, text: str) -> ForeignFileError:
        """Return the error of its place in its file."""
        return wrong(self.path, self.line, text)

    def numbers(self, count: int) -> list[float]:
        """Parse its text, numbers with white space between them.

        Raises:
            ForeignFileError: If there are not so many finite ones.
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
    """Read a file, and return its outermost element.

    Text that is not in the encoding that the file declares, UTF-8 by default, is taken
    for Latin-1.

    Raises:
        ForeignFileError: If it cannot be read, is no XML, declares a document type, or
            is too large.
    """
    content = read_bytes(path)
    parser = expat.ParserCreate(_encoding(content))
    open_ = [XmlElement("", {}, path, 0)]  # the file, and elements in each other
    count = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        element = XmlElement(tag, attributes, path, parser.CurrentLineNumber)
        count += 1
        if len(open_) > MAX_DEPTH or count > MAX_ELEMENTS:
            text = f"more than {MAX_DEPTH} levels or {MAX_ELEMENTS} elements"
            raise wrong(path, element.line, text)
        open_[-1].children.append(element)
        open_.append(element)

    def add_text(text: str) -> None:
        open_[-1].text += text

    def refuse(*_: object) -> None:
        # Entities, which a document type declares, could become gigabytes.
        raise wrong(path, parser.CurrentLineNumber, "a document type, expected none")

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: open_.pop()
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
    return open_[0].children[0]


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
