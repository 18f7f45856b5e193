"""Every exception radarsim raises on purpose.

* RadarsimError
    * ProtocolError -- the peer broke the USARSim text protocol
        * MalformedMessage -- a line, a number or a vector that cannot be read
        * LineTooLong -- the only one that closes the connection
    * MapError -- a file under maps/ is wrong; names the file, the place and the key
    * PresetError -- an unknown sensor, robot class or setting, or a value out of range
    * EngineError -- Embree cannot be opened, or was handed something it would misread
    * ServerError -- the server cannot start: the port is taken, the address is not ours
    * ClientError -- a server cannot be reached, is gone, or lacks what is needed
        * ClientTimeout -- it did not say in time what was needed; it may still do so
    * NavigationError -- a robot cannot do what is asked of it: it is blind, or too wide

Bugs of our own stay ValueError, TypeError and AssertionError.
"""


class RadarsimError(Exception):
    """The root of the tree."""


class ProtocolError(RadarsimError):
    """The peer broke the USARSim text protocol."""


class MalformedMessage(ProtocolError):
    """A line, a number or a vector that cannot be read."""


class LineTooLong(ProtocolError):
    """More bytes without a line end than any client sends."""


class MapError(RadarsimError):
    """A map file is wrong.

    Attributes:
        problems: One text for each problem, ``file:line:column: key.path: message``.
    """

    def __init__(self, problems: list[str]) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems

    def __reduce__(self) -> tuple[type["MapError"], tuple[list[str]]]:
        """Pickle the problems, not the text that they are joined to."""
        return type(self), (self.problems,)


class PresetError(RadarsimError):
    """An unknown sensor, robot class or setting, or a value out of range."""


class EngineError(RadarsimError):
    """Embree cannot be opened, or was handed something it would misread."""


class ServerError(RadarsimError):
    """The server cannot start."""


class ClientError(RadarsimError):
    """A server cannot be reached, closed the connection, or lacks what is needed."""


class ClientTimeout(ClientError):
    """A server did not say in time what was needed; the connection still stands."""


class MappingError(RadarsimError):
    """A map cannot be made of what a server tells."""


class NavigationError(RadarsimError):
    """A robot cannot do what is asked of it."""
