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
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias, TypeVar

from radarsim.errors import LineTooLong, MalformedMessage
from radarsim.geometry import Pose3, wrap_angle

_BLANKS = b" \t\n\r\v\f\x1c\x1d\x1e\x1f\x85\xa0"  # in Latin-1
# With the blank lines after it, of which there can be thousands in one packet.
_LINE_END = re.compile(rb"[\r\n][%b]*" % re.escape(_BLANKS))
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
    bare LF, which all occur in the field, are one line end each. Bytes are decoded as
    Latin-1, so none are refused here.

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

    def __init__(self, limit: int = 65536) -> None:
        self.limit = limit
        self.overflow: LineTooLong | None = None
        self._pending = bytearray()

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
        *ended, rest = _LINE_END.split(data)
        for piece in ended:
            if not self._append(piece):
                return lines
            line = self._pending.decode("latin-1").strip()
            self._pending.clear()
            if line:
                lines.append(line)
        self._append(rest)
        return lines

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
            self._pending.clear()
            self.overflow = LineTooLong(
                f"line of {size} bytes, expected at most {self.limit}"
            )
            return False
        self._pending += piece
        return True


LARGEST_COMMANDED = 1e9  # m, rad, rad/s; what follows from it can still be written
# compiled into kernels
LARGEST = 2.0**31  # in reports; the original casts to 32 bit integers

_NUMBER = re.compile(r"[+-]?([0-9]+([.,][0-9]*)?|[.,][0-9]+)([eE][+-]?[0-9]+)?")
_PLAIN_NUMBERS = re.compile(r"-?[0-9]+(\.[0-9]+)?(,-?[0-9]+(\.[0-9]+)?)*")
_LIST = re.compile(r"[-+0-9.eE, ]*")  # float() would also accept nan, inf and 1_0


def parse_number(text: str, *, largest: float = LARGEST) -> float:
    """Parse one number with a decimal point or a decimal comma.

    >>> parse_number("-0,5"), parse_number(".4"), parse_number("+1")
    (-0.5, 0.4, 1.0)

    Raises:
        MalformedMessage: If the text is not a number, or larger than ``largest``.
    """
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
    # As nearly all servers write them.
    if count > 1 and _PLAIN_NUMBERS.fullmatch(text):
        numbers = tuple(map(float, text.split(",")))
        if len(numbers) == count and max(numbers) <= largest >= -min(numbers):
            return numbers
    # UsarCommander writes "47,17 -55,70 -2,25" under a locale with decimal commas,
    # others "1, 2, 3" or "1 2 3": the count of words tells them apart.
    joined = " ".join(text.split()).replace(" ,", ",")
    words = joined.split()
    if len(words) == count:
        parts = [word.removesuffix(",") for word in words]
    else:
        parts = joined.split(",")
    if len(parts) != count:
        raise MalformedMessage(f"{text[:80]!r}, expected {count} numbers")
    return tuple(parse_number(part, largest=largest) for part in parts)


def parse_list(text: str) -> list[float]:
    """Parse one or more numbers separated by commas, blanks or both.

    Only decimal points are accepted: when the count is unknown, a decimal comma cannot
    be distinguished from a separator.

    Raises:
        MalformedMessage: If the list is empty, or a number in it is not readable or
            above ``LARGEST``.
    """
    return parse_words(text.replace(",", " ").split(), text)


def parse_words(words: Sequence[str], text: str) -> list[float]:
    """Parse the words of a list of numbers; see ``parse_list``.

    Args:
        words: The words, without commas.
        text: The words with blanks or commas between them.

    Raises:
        MalformedMessage: As ``parse_list`` does.
    """
    if not words or not _LIST.fullmatch(text):
        raise MalformedMessage(f"{text[:80]!r}, expected numbers")
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        raise MalformedMessage(f"{text[:80]!r}, expected numbers") from None
    if max(numbers) > LARGEST or min(numbers) < -LARGEST:
        raise MalformedMessage(f"{text[:80]!r}, expected at most {LARGEST:g} each")
    return numbers


def parse_flag(text: str, *, any_case: bool = True) -> bool:
    """Parse a truth value: ``true`` is true, everything else is false.

    Args:
        text: Value of the field.
        any_case: Whether ``True`` is true as well.
    """
    return (text.lower() if any_case else text) == "true"


Triple: TypeAlias = tuple[float, float, float]
Value = TypeVar("Value")

MAX_SEGMENTS = 1000  # of a line; a client can send some 20 000, which takes 10 ms

_SEGMENT = re.compile(r"\{([^{}]*)\}")


@dataclass(frozen=True, slots=True)
class Message:
    """The verb and the segments of one line.

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
        values = {key.lower(): value for key, value in reversed(self.segments)}
        object.__setattr__(self, "_values", values)

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
        return self._parse(key, self.require(key), parse)

    def parse_optional(self, key: str, parse: Callable[[str], Value]) -> Value | None:
        """Parse the value of a key; return None if it is missing or empty.

        Raises:
            MalformedMessage: If it is not readable; names the key.
        """
        text = self.get(key)
        return self._parse(key, text, parse) if text else None

    def number_or_nan(self, key: str) -> float:
        """Parse a number; return NaN if it is missing or empty.

        Raises:
            MalformedMessage: If it is not readable.
        """
        number = self.parse_optional(key, parse_number)
        return math.nan if number is None else number

    def items(self) -> Iterator["Message"]:
        """Yield the segments of each item; a repeated key starts the next item."""
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
        segments: list[tuple[str, str]] = []
        for key, value in self.segments:
            first, *rest = inner.split(value)
            segments.append((key, first.strip()))
            if rest:
                rest = [part.strip() for part in rest]
                segments += zip(rest[::2], rest[1::2], strict=True)
        return Message(self.verb, tuple(segments))

    def _parse(self, key: str, text: str, parse: Callable[[str], Value]) -> Value:
        try:
            return parse(text)
        except MalformedMessage as error:
            raise MalformedMessage(f"{self.verb} {key}: {error}") from None


def encode_segments(verb: str, segments: Iterable[tuple[str, str]]) -> str:
    """Write a line of keys and values without a line end."""
    groups = [f"{{{f'{key} {value}'.rstrip()}}}" for key, value in segments]
    return " ".join([verb, *groups])


def decode_message(line: str) -> Message:
    """Split one line into its verb and its segments.

    >>> decode_message("DRIVE{Left 1}{ Right  -0,5 }")
    Message(verb='DRIVE', segments=(('Left', '1'), ('Right', '-0,5')))

    Raises:
        MalformedMessage: If the verb is missing, if other text than a segment follows
            it, if a brace is not closed, or if there are more segments than
            ``MAX_SEGMENTS``.
    """
    head, _, _ = line.partition("{")
    if not head.strip():
        raise _expected("a verb", 0, line)
    verb, *rest = head.split(maxsplit=1)
    if rest:
        raise _expected("'{Key value}'", len(head) - len(rest[0]), line)
    count = line.count("{")
    if count > MAX_SEGMENTS:
        raise MalformedMessage(
            f"{count} segments in {line[:80]!r}, expected at most {MAX_SEGMENTS}"
        )
    segments = parse_segments(line)
    if len(segments) == count:
        return Message(verb, segments)
    # A stray brace would otherwise swallow the next field without a word.
    if len(_SEGMENT.findall(line)) != count:
        raise _expected("'}' after the brace", _find_open_brace(line), line)
    return Message(verb, segments)


def parse_segments(text: str) -> tuple[tuple[str, str], ...]:
    """Return key and value of each segment in a text with closed braces."""
    groups = [group.split(maxsplit=1) for group in _SEGMENT.findall(text)]
    return tuple(
        [
            (group[0], group[1].rstrip() if len(group) > 1 else "")
            for group in groups
            if group
        ]
    )


@functools.cache
def _inner_keys(keys: tuple[str, ...]) -> re.Pattern[str]:
    return re.compile(rf"\s({'|'.join(keys)})\s", re.IGNORECASE)


def _find_open_brace(line: str) -> int:
    """Return the index of the first brace that no closing brace belongs to."""
    closed = {match.start() for match in _SEGMENT.finditer(line)}
    return next(i for i, sign in enumerate(line) if sign == "{" and i not in closed)


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


def wrapped_pose_on_wire(pose: Pose3) -> tuple[float, ...]:
    """Return x, y, z, m, and roll, pitch, yaw, rad, in the frame of the wire.

    The angles are in (-pi, pi]. Wrapping those that are would take most of the time.
    """
    roll, pitch, yaw = pose.roll, 0.0 - pose.pitch, 0.0 - pose.yaw
    # Ground truth has these angles in ten lines a second for each robot.
    if not -math.pi < roll <= math.pi:
        roll = wrap_angle(roll)
    if not -math.pi < pitch <= math.pi:
        pitch = wrap_angle(pitch)
    if not -math.pi < yaw <= math.pi:
        yaw = wrap_angle(yaw)
    return (pose.x, 0.0 - pose.y, 0.0 - pose.z, roll, pitch, yaw)


def parse_triple(text: str, *, largest: float = LARGEST) -> Triple:
    """Parse three numbers.

    Raises:
        MalformedMessage: If the text is not three numbers up to ``largest``.
    """
    first, second, third = parse_numbers(text, 3, largest=largest)
    return (first, second, third)


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
    roll, pitch, yaw = angles
    return Pose3(*position, wrap_angle(roll), wrap_angle(pitch), wrap_angle(yaw))
