"""Split a stream of bytes, which TCP may cut anywhere, into lines."""

import re

from radarsim.errors import LineTooLong

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

    def _append(self, piece: bytes) -> bool:
        """Append to the pending line; return whether it is within the limit."""
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
