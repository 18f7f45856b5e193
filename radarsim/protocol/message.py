"""Parses a byte stream into lines of the form ``VERB {Key value} {Key value}``.

White space around and inside braces is ignored, and so is text between two segments.
Segments do not nest. Keys are case-insensitive, and the first of two equal keys counts.
Verbs keep their case here because clients distinguish replies by it.

Numbers are read as existing clients send them: with the decimal comma of their locale,
and with spaces or commas between the numbers of a vector. ``nan``, ``1e400`` and
``abc`` are refused, so that no such number reaches the simulation.

The axes on the wire are x forward, y right and z down, and yaw is clockwise from above.
They are the axes of REP-103 rotated by 180 degrees about x. This rotation is its own
inverse, and it acts on roll, pitch and yaw as on x, y and z: the first number keeps its
sign, the other two change their signs.
"""

import functools
import math
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias, TypeVar

import numpy as np
from pydantic_core import from_json

from radarsim.errors import LineTooLong, MalformedMessage
from radarsim.geometry import Floats, Pose3, wrap_angle

# White space in Latin-1; clients in C may also send the zero bytes that end strings.
_BLANKS = b"\0 \t\n\r\v\f\x1c\x1d\x1e\x1f\x85\xa0"
# One line end and the blank lines after it, which can be thousands. Callers replace CR
# by LF first, because a search for one character is several times faster.
_LINE_END = re.compile(rb"\n[%b]*" % re.escape(_BLANKS))
_ANY_END = re.compile(rb"\r\n|\n\r|\r|\n")
# Bytes that may precede the first line: the byte order mark of UTF-8, which editors
# and .NET programs write, and the option negotiation of telnet clients.
_PREAMBLE = re.compile(
    r"(?:\xef\xbb\xbf|\xff(?:[\xfb-\xfe].?|\xfa.*?\xff\xf0|[\xf1-\xf9])|\0)*",
    re.DOTALL,
)
# The HTTP method may be any word: by DNS rebinding, a web page can send requests of any
# method to this address. The last alternative is the start of a TLS handshake.
_HTTP_REQUEST = re.compile(r"[^\s{}]+\s+\S+\s+HTTP/\d|\x16\x03", re.IGNORECASE)


def is_http_request(line: str) -> bool:
    """Return whether a line is the start of an HTTP request or a TLS handshake.

    Any web page can make the browser of a user send an HTTP request to any port, with
    arbitrary lines after the request line.

    >>> is_http_request("POST / HTTP/1.1")
    True
    >>> is_http_request("m-search * HTTP/1.1")
    True
    >>> is_http_request("DRIVE {Left 1} {Right 1}")
    False
    """
    return _HTTP_REQUEST.match(line) is not None


class LineBuffer:
    r"""Splits received bytes into lines, and keeps an incomplete line until it ends.

    A line ends at CR or at LF. Empty and blank lines are dropped, so that CRLF, LF CR
    and LF, which clients use, all count as one line end. If blank lines are kept,
    adjacent CR and LF are one line end. A byte order mark of UTF-8 and telnet options
    before the first line are dropped. Bytes are decoded as Latin-1, which accepts all
    bytes.

    >>> lines = LineBuffer()
    >>> lines.feed(b"DRIVE {Left 1}")
    []
    >>> lines.feed(b" {Right 1}\n\rGETSTARTPOSES\r\n")
    ['DRIVE {Left 1} {Right 1}', 'GETSTARTPOSES']

    Attributes:
        limit: Maximum length of a line in bytes, without leading white space and line
            end.
        overflow: The error of a line that exceeds ``limit``; None before. The caller
            handles the lines before it and then closes the connection.
    """

    def __init__(self, limit: int = 65536, *, keeps_blank: bool = False) -> None:
        self.limit = limit
        self.overflow: LineTooLong | None = None
        self._pending = b""
        self._keeps_blank = keeps_blank
        self._is_first = True
        self._half_end = b""  # last byte if it is CR or LF and may be half a line end

    def feed(self, data: bytes) -> list[str]:
        """Add received bytes, and return the lines that are now complete.

        Raises:
            LineTooLong: If an earlier call has set ``overflow``.
        """
        if self.overflow is not None:
            raise self.overflow
        lines: list[str] = []
        # Clients end lines with CRLF, LF CR, or LF. A line ends at the first of these
        # characters; the second one only adds a blank line.
        if self._keeps_blank:
            *ended, rest = self._split_at_each_end(data)
        else:
            *ended, rest = _LINE_END.split(data.replace(b"\r", b"\n"))
        for piece in ended:
            if not self._append(piece):
                return lines
            line = self._pending.rstrip(_BLANKS).decode("latin-1")
            self._pending = b""
            if line and self._is_first:
                self._is_first, line = False, _PREAMBLE.sub("", line, 1)
            if line or self._keeps_blank:
                lines.append(line)
        self._append(rest)
        return lines

    def _split_at_each_end(self, data: bytes) -> list[bytes]:
        """Split bytes at CR, LF or a pair of both; a pair may come in two calls."""
        if self._half_end and data[:1] in (b"\r", b"\n") and data[:1] != self._half_end:
            data, self._half_end = data[1:], b""
        if data:
            *_, last = _ANY_END.findall(data) or [b""]
            self._half_end = last if len(last) == 1 and data.endswith(last) else b""
        return _ANY_END.split(data)

    def has_room_for(self, data: bytes) -> bool:
        """Return whether the pending line has room for data without a line end."""
        return len(self._pending) + len(data) <= self.limit

    def _append(self, piece: bytes) -> bool:
        """Append bytes to the pending line; return whether the line is short enough."""
        # White space before a line does not count towards the limit of its length.
        if not self._pending:
            piece = piece.lstrip(_BLANKS)
        size = len(self._pending) + len(piece)
        if size > self.limit:
            self._pending = b""
            self.overflow = LineTooLong(
                f"line of {size} bytes, expected at most {self.limit}"
            )
            return False
        self._pending += piece
        return True


# Largest number in commands, m, rad or rad/s. Reports can still express all results
# that are computed from numbers of this size.
LARGEST_COMMANDED = 1e9
# Limit of numbers in reports, as in lines.hpp; the original server has 32-bit integers.
LARGEST = 2.0**31
_LARGEST_WRITTEN = 2.0**31 - 128.0  # the largest float32 below LARGEST

_NUMBER = re.compile(r"[+-]?([0-9]+([.,][0-9]*)?|[.,][0-9]+)([eE][+-]?[0-9]+)?")
# Most numbers from servers have this form, which float() accepts without more checks.
_PLAIN_NUMBER = re.compile(r"-?[0-9]{1,9}(?:\.[0-9]+)?")
_PLAIN_TRIPLE = re.compile(",".join([f"({_PLAIN_NUMBER.pattern})"] * 3))
_LIST = re.compile(r"[-+0-9.eE, ]*")  # float() would also accept nan, inf and 1_0


def clip_numbers(numbers: Floats) -> Floats:
    """Return the numbers clipped to a magnitude below ``LARGEST``, and 0 for NaN."""
    text = "a number in a line was clipped to a magnitude below 2**31"
    warnings.warn(text, RuntimeWarning, stacklevel=1)  # Python shows it once
    finite = np.nan_to_num(numbers, nan=0.0)
    return np.clip(finite, -_LARGEST_WRITTEN, _LARGEST_WRITTEN)


def parse_number(text: str, *, largest: float = LARGEST) -> float:
    """Parse one number with a decimal point or a decimal comma.

    >>> parse_number("-0,5"), parse_number(".4"), parse_number("+1")
    (-0.5, 0.4, 1.0)

    Args:
        text: The number.
        largest: Largest size of a number, at least ``LARGEST_COMMANDED``.

    Raises:
        MalformedMessage: If the text is not a number, or larger than ``largest``.
    """
    if _PLAIN_NUMBER.fullmatch(text):
        return float(text)
    digits = text.strip()
    if not _NUMBER.fullmatch(digits):
        raise MalformedMessage(f"{text[:80]!r}, expected a number")
    number = float(digits.replace(",", "."))
    if abs(number) > largest:
        raise MalformedMessage(f"{text[:80]!r}, expected at most {largest:g}")
    return number


def parse_numbers(
    text: str, count: int, *, largest: float = LARGEST
) -> tuple[float, ...]:
    """Parse a vector of at least two numbers in any form that clients send.

    If the text has ``count`` words, each word is a number, and a comma inside a word is
    the decimal comma of the client's locale. Otherwise commas separate the numbers.

    >>> parse_numbers("4.5,1.9,1.8", 3) == parse_numbers("4,5, 1,9, 1,8", 3)
    True

    Raises:
        MalformedMessage: If the text is not ``count`` numbers, or one of them is
            larger than ``largest``.
    """
    # UsarCommander writes "47,17 -55,70 -2,25" under a locale with decimal commas,
    # other clients "1, 2, 3" or "1 2 3": the number of words distinguishes these forms.
    joined = " ".join(text.split()).replace(" ,", ",")
    words = joined.split()
    if len(words) == count:
        parts = [word.removesuffix(",") for word in words]
    else:
        parts = joined.split(",")
    if len(parts) != count:
        raise MalformedMessage(f"{text[:80]!r}, expected {count} numbers")
    return tuple(parse_number(part, largest=largest) for part in parts)


def parse_list(text: str) -> Floats:
    """Parse one or more numbers separated by commas, spaces or both; return (N,).

    Only decimal points are accepted: when the count is unknown, a decimal comma cannot
    be distinguished from a separator.

    Raises:
        MalformedMessage: If the list is empty, or a number in it is not readable or
            above ``LARGEST``.
    """
    numbers = _parse_plain_list(text)
    if numbers is None:
        words = text.replace(",", " ").split()
        if not words or not _LIST.fullmatch(text):
            raise MalformedMessage(f"{text[:80]!r}, expected numbers")
        try:
            numbers = np.array([float(word) for word in words])
        except ValueError:
            raise MalformedMessage(f"{text[:80]!r}, expected numbers") from None
    if np.abs(numbers).max() > LARGEST:
        raise MalformedMessage(f"{text[:80]!r}, expected at most {LARGEST:g} each")
    return numbers


def _parse_plain_list(text: str) -> Floats | None:
    """Parse comma-separated numbers by a JSON parser; return None for other texts.

    The result equals that of ``float``, and takes a fifth of the time. Ranges make up
    most of the data that a client receives.
    """
    try:
        digits = text.encode()
        if not digits or digits.translate(None, b"-.,0123456789"):
            return None
        array = b"[%b]" % digits
        # The JSON parser would drop the sign of the integer -0.
        if b"-0," in array or b"-0]" in array:
            return None
        return np.fromiter(from_json(array), np.float64)
    except (ValueError, OverflowError):
        return None


def parse_flag(text: str) -> bool:
    """Parse a Boolean: ``true`` in any case is true, everything else is false."""
    return text.lower() == "true"


Triple: TypeAlias = tuple[float, float, float]
Value = TypeVar("Value")

MAX_SEGMENTS = 1000  # per line; without it, 20 000 would fit, and take 10 ms to parse


@dataclass(slots=True)  # not frozen, which would double the time to create one
class Message:
    """A parsed line: its verb and its ``{Key value}`` segments; treat as immutable.

    Attributes:
        verb: First word of the line.
        segments: Key and value of each segment, in order. ``{Name }`` has an empty
            value; ``{}`` is left out. The value of a list of start poses or of an
            item's mount contains spaces.
    """

    verb: str
    segments: tuple[tuple[str, str], ...] = ()
    _values: dict[str, str] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        # The dictionary is filled in reverse order, so that the first of two equal keys
        # overwrites the second.
        self._values = {key.lower(): value for key, value in self.segments[::-1]}

    def encode(self) -> str:
        """Encode the message as a line without a line end."""
        return encode_segments(self.verb, self.segments)

    def get(self, key: str) -> str | None:
        """Return the first value of a case-insensitive key; None if it is missing."""
        return self._values.get(key.lower())

    @property
    def name(self) -> str:
        """The value of the key ``Name``; empty if the key is missing."""
        return self.get("Name") or ""

    def require(self, key: str) -> str:
        """Return the value of a key that the line must have.

        Raises:
            MalformedMessage: If the value is missing or empty.
        """
        value = self.get(key)
        if not value:
            raise MalformedMessage(
                f"{self.encode()[:80]!r}, expected a field '{{{key} ...}}'"
            )
        return value

    def parse(self, key: str, parse: Callable[[str], Value]) -> Value:
        """Parse the value of a key that the line must have.

        Raises:
            MalformedMessage: If the value is missing, empty or not readable. The error
                names the key.
        """
        text = self._values.get(key.lower()) or self.require(key)
        try:
            return parse(text)
        except MalformedMessage as error:
            raise MalformedMessage(f"{self.verb} {key}: {error}") from None

    def parse_optional(self, key: str, parse: Callable[[str], Value]) -> Value | None:
        """Parse the value of a key; return None if it is missing or empty.

        Raises:
            MalformedMessage: If the value is not readable. The error names the key.
        """
        return self.parse(key, parse) if self._values.get(key.lower()) else None

    def number_or_nan(self, key: str) -> float:
        """Return the value of a key as a number; NaN if it is missing or empty.

        Raises:
            MalformedMessage: If the number is not readable.
        """
        return self.parse(key, parse_number) if self.get(key) else math.nan

    def items(self) -> Iterator["Message"]:
        """Split a line about several items into a message for each of them.

        If no key is repeated, the whole line is the only item.
        """
        values = self._values
        if len(values) == len(self.segments):
            if len(values) > ("type" in values) + ("time" in values):
                yield self
            return
        item: list[tuple[str, str]] = []
        keys: set[str] = set()
        for name, value in self.segments:
            key = name.lower()
            if key in ("type", "time"):
                continue
            if key in keys:
                yield Message(self.verb, tuple(item))
                item.clear()
                keys.clear()
            item.append((name, value))
            keys.add(key)
        if item:
            yield Message(self.verb, tuple(item))

    def split_fields(self, *keys: str) -> "Message":
        """Return a message in which each field of an item has its own segment.

        Servers of some generations write all fields of an item into one segment.

        >>> Message("SEN", (("Name", "Bumper Touch True"),)).split_fields("Touch")
        Message(verb='SEN', segments=(('Name', 'Bumper'), ('Touch', 'True')))

        Args:
            keys: Keys of the fields other than the name, in any case.
        """
        inner = _inner_keys(keys)
        if not any(map(inner.search, [value for _, value in self.segments])):
            return self
        segments: list[tuple[str, str]] = []
        for key, value in self.segments:
            first, *rest = inner.split(value)
            segments.append((key, first.strip()))
            if rest:
                rest = [part.strip() for part in rest]
                segments += zip(rest[::2], rest[1::2], strict=True)
        return Message(self.verb, tuple(segments))


def encode_segments(verb: str, segments: Iterable[tuple[str, str]]) -> str:
    """Join a verb, keys and values to a line without a line end."""
    groups = [f"{{{f'{key} {value}'.rstrip()}}}" for key, value in segments]
    return " ".join([verb, *groups])


def decode_message(line: str, *, keeps_closed: bool = False) -> Message:
    """Split a line of the protocol into its verb and its ``{Key value}`` segments.

    >>> decode_message("DRIVE{Left 1}{ Right  -0,5 }")
    Message(verb='DRIVE', segments=(('Left', '1'), ('Right', '-0,5')))

    Args:
        line: The line.
        keeps_closed: Whether an unclosed last segment is left out instead of raising an
            error, as the original server does with commands.

    Raises:
        MalformedMessage: If the verb is missing, if other text than a segment follows
            the verb, if a brace is not closed, or if there are more segments than
            ``MAX_SEGMENTS``.
    """
    head, *parts = line.split("{", MAX_SEGMENTS + 1)
    if not head.strip():
        raise _expected("a verb", 0, line)
    verb, *rest = head.split(maxsplit=1)
    if rest:
        raise _expected("'{Key value}'", len(head) - len(rest[0]), line)
    if len(parts) > MAX_SEGMENTS:
        text = f"{line.count('{')} segments in {line[:80]!r}"
        raise MalformedMessage(f"{text}, expected at most {MAX_SEGMENTS}")
    return Message(verb, _parse_parts(parts, line, keeps_closed=keeps_closed))


def parse_segments(
    text: str, *, keeps_closed: bool = False
) -> tuple[tuple[str, str], ...]:
    """Return key and value of each ``{Key value}`` segment in a text.

    Raises:
        MalformedMessage: If a brace is not closed.
    """
    return _parse_parts(text.split("{")[1:], text, keeps_closed=keeps_closed)


def _parse_parts(
    parts: Sequence[str], text: str, *, keeps_closed: bool
) -> tuple[tuple[str, str], ...]:
    """Return key and value of each segment of a text that is split at ``{``."""
    segments = []
    for index, part in enumerate(parts):
        inside, brace, _ = part.partition("}")
        if not brace:
            if keeps_closed and index == len(parts) - 1:
                break
            # Without this error, a stray brace would silently hide the next field.
            after = sum(len(each) + 1 for each in parts[index:])
            raise _expected("'}' to close the brace", len(text) - after, text)
        words = inside.split(None, 1)
        if len(words) == 2:
            segments.append((words[0], words[1].rstrip()))
        elif words:
            segments.append((words[0], ""))
    return tuple(segments)


@functools.cache
def _inner_keys(keys: tuple[str, ...]) -> re.Pattern[str]:
    return re.compile(rf"\s({'|'.join(keys)})\s", re.IGNORECASE)


def _expected(expected: str, index: int, line: str) -> MalformedMessage:
    return MalformedMessage(
        f"expected {expected} at column {index + 1} in {line[:80]!r}"
    )


def flip_axes(triple: Triple) -> Triple:
    """Convert x, y, z or roll, pitch, yaw from the wire frame to REP-103 or back.

    The conversion is the same in both directions and never returns -0.0.

    >>> flip_axes((1.0, 2.0, 0.0))
    (1.0, -2.0, 0.0)
    """
    first, second, third = triple
    return (first, 0.0 - second, 0.0 - third)


def parse_triple(text: str, *, largest: float = LARGEST) -> Triple:
    """Parse a text with three numbers, such as a position or angles.

    Raises:
        MalformedMessage: If the text is not three numbers up to ``largest``.
    """
    match = _PLAIN_TRIPLE.fullmatch(text)
    first, second, third = (
        match.groups() if match else parse_numbers(text, 3, largest=largest)
    )
    return (float(first), float(second), float(third))


def parse_flipped(text: str, *, largest: float = LARGEST) -> Triple:
    """Parse x, y, z or roll, pitch, yaw in the wire frame and convert to REP-103.

    Raises:
        MalformedMessage: If the text is not three numbers up to ``largest``.
    """
    return flip_axes(parse_triple(text, largest=largest))


def pose_from_wire(numbers: Sequence[float]) -> Pose3:
    """Build a pose from x, y, z, roll, pitch, yaw in the wire frame."""
    x, y, z, roll, pitch, yaw = numbers
    return Pose3(*flip_axes((x, y, z)), *flip_axes((roll, pitch, yaw)))


def wrapped_pose(position: Triple, angles: Triple) -> Pose3:
    """Build a pose with angles wrapped to (-pi, pi]; some servers send up to 2 pi.

    Args:
        position: x, y, z, m, REP-103.
        angles: Roll, pitch, yaw, rad, REP-103.
    """
    x, y, z = position
    roll, pitch, yaw = angles
    return Pose3(x, y, z, wrap_angle(roll), wrap_angle(pitch), wrap_angle(yaw))
