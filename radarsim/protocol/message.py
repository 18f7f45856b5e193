"""Lines of the protocol, from a stream of bytes: ``VERB {Key value} {Key value}``.

White space around and inside braces is ignored, and so is text between two segments.
Segments do not nest. Keys match in any case, and the first of two equal keys counts.
Verbs keep their case here because clients distinguish replies by it.

Numbers are read as existing clients send them: with the decimal comma of their locale,
and with blanks or commas between the numbers of a vector. ``nan``, ``1e400`` and
``abc`` are refused, so that no such number reaches the simulation.

The axes of the wire point x forward, y right and z down, and yaw is clockwise from
above. They are the axes of REP-103 after half a turn about x. That rotation is its own
inverse, and it acts on roll, pitch and yaw as on x, y and z: the first number keeps its
sign, the other two change theirs.
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

# In Latin-1. Programs in C send the ends of their strings as well, which are zeros.
_BLANKS = b"\0 \t\n\r\v\f\x1c\x1d\x1e\x1f\x85\xa0"
# With the blank lines after it; there can be thousands in one packet. CR is
# replaced before: a search for one character is several times as fast as for two.
_LINE_END = re.compile(rb"\n[%b]*" % re.escape(_BLANKS))
_ANY_END = re.compile(rb"\r\n|\n\r|\r|\n")
# Before the first line: the mark of UTF-8, of editors and of programs in .NET, and the
# options that a telnet client offers. Both in Latin-1.
_PREAMBLE = re.compile(
    r"(?:\xef\xbb\xbf|\xff(?:[\xfb-\xfe].?|\xfa.*?\xff\xf0|[\xf1-\xf9])|\0)*",
    re.DOTALL,
)
# Methods are of any characters and case: pages choose them for their own site, whose
# name they can make resolve to here. Or TLS, whose first message has bytes of theirs.
_HTTP_REQUEST = re.compile(r"[^\s{}]+\s+\S+\s+HTTP/\d|\x16\x03", re.IGNORECASE)


def is_http_request(line: str) -> bool:
    """Return whether a line begins a request of a web browser, or a TLS connection.

    Any page that a user visits can make a browser send one to any port, with lines of
    the page's choice after it.

    >>> is_http_request("POST / HTTP/1.1")
    True
    >>> is_http_request("m-search * HTTP/1.1")
    True
    >>> is_http_request("DRIVE {Left 1} {Right 1}")
    False
    """
    return _HTTP_REQUEST.match(line) is not None


class LineBuffer:
    r"""Collects received bytes and returns whole lines.

    A line ends at CR or at LF. Empty and blank lines are dropped, so CRLF, LF CR and
    bare LF, which all occur in the field, are one line end each. Where blank lines are
    kept, adjacent CR and LF are one line end. The mark of UTF-8 and the options of
    telnet before the first line are dropped. Bytes are decoded as Latin-1, so none are
    refused here.

    >>> lines = LineBuffer()
    >>> lines.feed(b"DRIVE {Left 1}")
    []
    >>> lines.feed(b" {Right 1}\n\rGETSTARTPOSES\r\n")
    ['DRIVE {Left 1} {Right 1}', 'GETSTARTPOSES']

    Attributes:
        limit: Maximum length of a line without blanks before it and its end, bytes.
        overflow: None until a line is longer than that. Then the connection is to be
            closed after the lines before it have been handled.
    """

    def __init__(self, limit: int = 65536, *, keeps_blank: bool = False) -> None:
        self.limit = limit
        self.overflow: LineTooLong | None = None
        self._pending = b""
        self._keeps_blank = keeps_blank
        self._is_first = True
        self._half_end = b""  # CR or LF that came last, if the other one may follow

    def feed(self, data: bytes) -> list[str]:
        """Add received bytes and return the lines that they complete.

        Raises:
            LineTooLong: If an earlier call has set ``overflow``.
        """
        if self.overflow is not None:
            raise self.overflow
        lines: list[str] = []
        # Clients end lines with CRLF, with LF CR, or with LF alone; a line ends at the
        # first of both, and what follows of the same line end is a blank line.
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
        """Split bytes at CR, LF, or both, also if the two came one after the other."""
        if self._half_end and data[:1] in (b"\r", b"\n") and data[:1] != self._half_end:
            data, self._half_end = data[1:], b""
        if data:
            *_, last = _ANY_END.findall(data) or [b""]
            self._half_end = last if len(last) == 1 and data.endswith(last) else b""
        return _ANY_END.split(data)

    def has_room_for(self, data: bytes) -> bool:
        """Return whether bytes cannot make a line too long, wherever it ends."""
        return len(self._pending) + len(data) <= self.limit

    def _append(self, piece: bytes) -> bool:
        """Append to the pending line; return whether it is within the limit."""
        # Without this a flood of blanks before a line would count against its limit.
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


LARGEST_COMMANDED = 1e9  # m, rad, rad/s; what follows from it can still be written
LARGEST = 2.0**31  # in reports, as in lines.hpp; the original casts to 32 bit integers
_LARGEST_WRITTEN = 2.0**31 - 128.0  # the largest number of single precision below that

_NUMBER = re.compile(r"[+-]?([0-9]+([.,][0-9]*)?|[.,][0-9]+)([eE][+-]?[0-9]+)?")
# As nearly all servers write them: below any limit, and float() reads them as they are.
_PLAIN_NUMBER = re.compile(r"-?[0-9]{1,9}(?:\.[0-9]+)?")
_PLAIN_TRIPLE = re.compile(",".join([f"({_PLAIN_NUMBER.pattern})"] * 3))
_LIST = re.compile(r"[-+0-9.eE, ]*")  # float() would also accept nan, inf and 1_0


def clip_numbers(numbers: Floats) -> Floats:
    """Return numbers that can be written: below ``LARGEST`` in size, and 0 for NaN."""
    text = "a number of a line is clipped, expected less than 2**31 in size"
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

    If there are as many words as numbers, blanks separate them, and a comma inside a
    word is the decimal comma of the client's locale. Otherwise commas separate them.

    >>> parse_numbers("4.5,1.9,1.8", 3) == parse_numbers("4,5, 1,9, 1,8", 3)
    True

    Raises:
        MalformedMessage: If the text is not that many numbers, or one of them is
            larger than ``largest``.
    """
    # UsarCommander writes "47,17 -55,70 -2,25" under a locale with decimal commas,
    # others "1, 2, 3" or "1 2 3": the count of words distinguishes them.
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
    """Parse one or more numbers separated by commas, blanks or both; return (N,).

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
    """Parse numbers as servers write them; return None for what JSON reads otherwise.

    The numbers are those of ``float``, in a fifth of its time: ranges are most of what
    a client receives.
    """
    try:
        digits = text.encode()
        if not digits or digits.translate(None, b"-.,0123456789"):
            return None
        array = b"[%b]" % digits
        # Whole numbers of JSON have no sign of zero.
        if b"-0," in array or b"-0]" in array:
            return None
        return np.fromiter(from_json(array), np.float64)
    except (ValueError, OverflowError):
        return None


def parse_flag(text: str) -> bool:
    """Parse a truth value: ``true`` in any case is true, everything else is false."""
    return text.lower() == "true"


Triple: TypeAlias = tuple[float, float, float]
Value = TypeVar("Value")

MAX_SEGMENTS = 1000  # of a line; a client can send some 20 000, which takes 10 ms


@dataclass(slots=True)  # not frozen, with which it would take twice as long to create
class Message:
    """The verb and the segments of one line, which do not change.

    Attributes:
        verb: First word of the line.
        segments: Key and value of each segment, in order. ``{Name }`` has an empty
            value; ``{}`` is left out. The value of a list of start poses or of an
            item's mount contains blanks.
    """

    verb: str
    segments: tuple[tuple[str, str], ...] = ()
    _values: dict[str, str] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        # Reversed, so that the first of two equal keys is the one that stays.
        self._values = {key.lower(): value for key, value in self.segments[::-1]}

    def encode(self) -> str:
        """Write the line without a line end."""
        return encode_segments(self.verb, self.segments)

    def get(self, key: str) -> str | None:
        """Return the first value of a key in any case, or None."""
        return self._values.get(key.lower())

    @property
    def name(self) -> str:
        """The value of ``Name``; empty if it is missing."""
        return self.get("Name") or ""

    def require(self, key: str) -> str:
        """Return the value of a key.

        Raises:
            MalformedMessage: If it is missing or empty.
        """
        value = self.get(key)
        if not value:
            raise MalformedMessage(
                f"{self.encode()[:80]!r}, expected a field '{{{key} ...}}'"
            )
        return value

    def parse(self, key: str, parse: Callable[[str], Value]) -> Value:
        """Parse the value of a key.

        Raises:
            MalformedMessage: If it is missing, empty or not readable; names the key.
        """
        text = self._values.get(key.lower()) or self.require(key)
        try:
            return parse(text)
        except MalformedMessage as error:
            raise MalformedMessage(f"{self.verb} {key}: {error}") from None

    def parse_optional(self, key: str, parse: Callable[[str], Value]) -> Value | None:
        """Parse the value of a key; return None if it is missing or empty.

        Raises:
            MalformedMessage: If it is not readable; names the key.
        """
        return self.parse(key, parse) if self.get(key) else None

    def number_or_nan(self, key: str) -> float:
        """Parse a number; return NaN if it is missing or empty.

        Raises:
            MalformedMessage: If it is not readable.
        """
        return self.parse(key, parse_number) if self.get(key) else math.nan

    def items(self) -> Iterator["Message"]:
        """Yield the segments of each item; a repeated key starts the next item.

        The only item of a line is the whole line.
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
        """Return the message with a segment of its own for each field of an item.

        Servers of some generations write the fields of an item into one segment.

        >>> Message("SEN", (("Name", "Bumper Touch True"),)).split_fields("Touch")
        Message(verb='SEN', segments=(('Name', 'Bumper'), ('Touch', 'True')))

        Args:
            keys: Keys of the fields besides the name, in any case.
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
    """Write a line of keys and values without a line end."""
    groups = [f"{{{f'{key} {value}'.rstrip()}}}" for key, value in segments]
    return " ".join([verb, *groups])


def decode_message(line: str, *, keeps_closed: bool = False) -> Message:
    """Split one line into its verb and its segments.

    >>> decode_message("DRIVE{Left 1}{ Right  -0,5 }")
    Message(verb='DRIVE', segments=(('Left', '1'), ('Right', '-0,5')))

    Args:
        line: The line.
        keeps_closed: Whether a last segment that is not closed is left out, as the
            original server does in commands, instead of an error.

    Raises:
        MalformedMessage: If the verb is missing, if other text than a segment follows
            it, if a brace is not closed, or if there are more segments than
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
    """Return key and value of each segment in a text; see ``decode_message``.

    Raises:
        MalformedMessage: If a brace is not closed.
    """
    return _parse_parts(text.split("{")[1:], text, keeps_closed=keeps_closed)


def _parse_parts(
    parts: Sequence[str], text: str, *, keeps_closed: bool
) -> tuple[tuple[str, str], ...]:
    """Parse the parts of a text after each of its opening braces."""
    segments = []
    for index, part in enumerate(parts):
        inside, brace, _ = part.partition("}")
        if not brace:
            if keeps_closed and index == len(parts) - 1:
                break
            # A stray brace would otherwise swallow the next field without a word.
            after = sum(len(each) + 1 for each in parts[index:])
            raise _expected("'}' after the brace", len(text) - after, text)
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
    """Convert x, y, z or roll, pitch, yaw between the frames; never return -0.0.

    >>> flip_axes((1.0, 2.0, 0.0))
    (1.0, -2.0, 0.0)
    """
    first, second, third = triple
    return (first, 0.0 - second, 0.0 - third)


def parse_triple(text: str, *, largest: float = LARGEST) -> Triple:
    """Parse three numbers.

    Raises:
        MalformedMessage: If the text is not three numbers up to ``largest``.
    """
    match = _PLAIN_TRIPLE.fullmatch(text)
    first, second, third = (
        match.groups() if match else parse_numbers(text, 3, largest=largest)
    )
    return (float(first), float(second), float(third))


def parse_flipped(text: str, *, largest: float = LARGEST) -> Triple:
    """Parse x, y, z or roll, pitch, yaw of the wire and convert them to REP-103.

    Raises:
        MalformedMessage: If the text is not three numbers up to ``largest``.
    """
    return flip_axes(parse_triple(text, largest=largest))


def pose_from_wire(numbers: Sequence[float]) -> Pose3:
    """Build a pose from x, y, z, roll, pitch, yaw in the frame of the wire."""
    x, y, z, roll, pitch, yaw = numbers
    return Pose3(*flip_axes((x, y, z)), *flip_axes((roll, pitch, yaw)))


def wrapped_pose(position: Triple, angles: Triple) -> Pose3:
    """Build a pose with wrapped angles; some servers count them to a full turn.

    Args:
        position: x, y, z, m, REP-103.
        angles: Roll, pitch, yaw, rad, REP-103.
    """
    x, y, z = position
    roll, pitch, yaw = angles
    return Pose3(x, y, z, wrap_angle(roll), wrap_angle(pitch), wrap_angle(yaw))
