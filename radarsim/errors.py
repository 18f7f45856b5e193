"""All exceptions that radarsim raises on purpose.

* RadarsimError
    * ProtocolError -- the peer broke the USARSim text protocol
        * MalformedMessage -- a line, a number or a vector that cannot be read
        * LineTooLong -- the only one that closes the connection
    * MapError -- a file under maps/ is wrong; names the file, the place and the key
    * ForeignFileError -- a file of another program cannot be imported; names the place
    * PresetError -- an unknown sensor, robot class or setting, or a value out of range
    * EngineError -- Embree cannot be loaded, or got input that it would misread
    * ServerError -- the server cannot start: its address is not available
        * PortUnavailable -- the port is in use, or reserved; port 0 takes a free one
    * ClientError -- a server is not reachable, disconnected, or lacks a feature
        * ClientTimeout -- no answer in time; the connection stays open
    * MappingError -- no map can be made from what a server sends
    * NavigationError -- a robot cannot do a task: it has no scanner, or is too wide
        * TooNearError -- a start or a goal is inside the safety distance
    * RecordingError -- a recording cannot be written, read, or repeated
    * SweepError -- a sweep file is wrong, or a sweep cannot be run
    * MissingPackage -- an optional package is not installed; names the extra

Programming errors stay ValueError, TypeError and AssertionError.
"""

from radarsim.printable_text import escape_lines, escape_unprintable


class RadarsimError(Exception):
    """The root of the tree; messages are printable, whatever names are in them."""

    def __init__(self, message: str = "", *details: object) -> None:
        super().__init__(escape_lines(message), *details)


class ProtocolError(RadarsimError):
    """The peer broke the USARSim text protocol."""


class MalformedMessage(ProtocolError):
    """A line, a number or a vector that cannot be read."""


class LineTooLong(ProtocolError):
    """More bytes without a line end than any client sends."""


class MapError(RadarsimError):
    """A map file is wrong.

    Attributes:
        problems: One text for each problem, ``file:line:column: key.path: message``;
            of very many the first, and a last text that says how many more.
    """

    def __init__(self, problems: list[str]) -> None:
        self.problems = [escape_unprintable(problem) for problem in problems]
        super().__init__("\n".join(self.problems))

    def __reduce__(self) -> tuple[type["MapError"], tuple[list[str]]]:
        """Pickle the problems, not the message that joins them."""
        return type(self), (self.problems,)


class ForeignFileError(RadarsimError):
    """A file of another program cannot be imported."""


class PresetError(RadarsimError):
    """An unknown sensor, robot class or setting, or a value out of range."""


class EngineError(RadarsimError):
    """Embree cannot be loaded, or got input that it would misread."""


class ServerError(RadarsimError):
    """The server cannot start."""


class PortUnavailable(ServerError):
    """The port to listen on is in use, or reserved; port 0 would take a free one.

    Attributes:
        port: The port.
    """

    def __init__(self, text: str, port: int) -> None:
        super().__init__(text, port)
        self.port = port

    def __str__(self) -> str:
        return str(self.args[0])


class ClientError(RadarsimError):
    """A server is not reachable, closed the connection, or lacks a feature."""


class ClientTimeout(ClientError):
    """A server did not answer in time; the connection stays open."""


class MappingError(RadarsimError):
    """No map can be made from what a server sends."""


class NavigationError(RadarsimError):
    """A robot cannot do a task."""


class TooNearError(NavigationError):
    """A start or a goal is nearer to something than the safety distance."""


class RecordingError(RadarsimError):
    """A recording cannot be written, read, or repeated."""


class SweepError(RadarsimError):
    """A sweep file is wrong, or a sweep cannot be run where it was asked to."""


class MissingPackage(RadarsimError, ImportError):
    """An optional package is not installed; the message names the extra."""
