"""All exceptions of radarsim, and functions that format their messages.

* RadarsimError
    * ProtocolError -- the peer violated the USARSim text protocol
        * MalformedMessage -- a line, a number or a vector cannot be parsed
        * LineTooLong -- a line is too long, which closes the connection
    * MapError -- a map file is invalid; names the file, the line and the key
    * ForeignFileError -- a file of another program cannot be imported; names the line
    * PresetError -- an unknown sensor, robot class or setting, or a value out of range
    * EngineError -- Embree cannot be loaded, or the engine got invalid input
    * ServerError -- the server cannot start: its address is not available
        * PortUnavailable -- the port is in use, or reserved; port 0 takes a free one
    * ClientError -- a server is not reachable, disconnected, or lacks a feature
        * ClientTimeout -- no answer in time; the connection stays open
    * MappingError -- no map can be built from a server's messages
    * NavigationError -- a robot cannot do a task: it has no scanner, or is too wide
        * TooNearError -- a start or a goal is inside the safety distance
    * RecordingError -- a recording cannot be written, read, or repeated
    * SweepError -- a sweep file is invalid, or a sweep cannot be run
    * MissingPackage -- an optional package is not installed; names the extra

Programming errors are ValueError, TypeError and AssertionError.

The functions escape control characters, which a terminal would execute, suggest known
names for an unknown name, and describe errors of the operating system.
"""

import errno
import importlib
import os
import re
import shlex
import socket
import sysconfig
from collections.abc import Collection, Iterable
from contextlib import suppress
from difflib import get_close_matches
from itertools import islice
from pathlib import Path
from typing import Any, Final

CUTOFF: Final = 0.6  # difflib's ratio, 0 to 1, above which names are similar
MAX_LENGTH: Final = 80  # characters of a name in a message
MAX_NAMES: Final = 100  # largest number of names in a message, and in a comparison
# Texts that replace less clear messages of the operating system, by error number. Some
# error numbers share a text.
_WORDS: Final = {
    errno.EACCES: "no permission",
    errno.EADDRINUSE: "the port is in use by another program",
    errno.EADDRNOTAVAIL: "not an address of this machine",
    errno.EDQUOT: "the disk is full",
    errno.EISDIR: "it is a folder",
    errno.ENOSPC: "the disk is full",
    errno.ENOTDIR: "no such folder",
    errno.EPERM: "no permission",
}


def escape_unprintable(text: str) -> str:
    r"""Escape all characters of a text that ``str.isprintable`` rejects.

    They are control characters, line ends, marks that change the direction of text,
    invisible separators and surrogates; ``repr`` escapes the same characters.
    Backslashes in the text are not escaped.

    >>> escape_unprintable("wall\x1b[2J\n")
    'wall\\x1b[2J\\n'
    """
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else repr(each)[1:-1] for each in text)


def escape_lines(text: str) -> str:
    r"""Apply ``escape_unprintable`` to each line of a text.

    >>> escape_lines("wall\x07\nbush")
    'wall\\x07\nbush'
    """
    return "\n".join(map(escape_unprintable, text.split("\n")))


class RadarsimError(Exception):
    """Base class of all exceptions of radarsim; it escapes unprintable characters."""

    def __init__(self, message: str = "", *details: object) -> None:
        super().__init__(escape_lines(message), *details)


class ProtocolError(RadarsimError):
    """A client or server violated the USARSim text protocol."""


class MalformedMessage(ProtocolError):
    """A line of the protocol, or a number or vector in it, cannot be parsed."""


class LineTooLong(ProtocolError):
    """A received line is longer than the limit, so the connection is closed."""


class MapError(RadarsimError):
    """A map file is invalid.

    Attributes:
        problems: One text for each problem, ``file:line:column: key.path: message``;
            if there are many, the first problems and the number of the others.
    """

    def __init__(self, problems: list[str]) -> None:
        self.problems = [escape_unprintable(problem) for problem in problems]
        super().__init__("\n".join(self.problems))

    def __reduce__(self) -> tuple[type["MapError"], tuple[list[str]]]:
        """Pickle only the list of problems, from which the message is built again."""
        return type(self), (self.problems,)


class ForeignFileError(RadarsimError):
    """A file of another program cannot be imported."""


class PresetError(RadarsimError):
    """A sensor, robot class or setting is unknown, or a value is out of range."""


class EngineError(RadarsimError):
    """Embree cannot be loaded, or the engine got invalid input."""


class ServerError(RadarsimError):
    """A server cannot start."""


class PortUnavailable(ServerError):
    """The port of a server is in use, or reserved; port 0 selects a free port.

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
    """No map can be built from a server's messages."""


class NavigationError(RadarsimError):
    """A robot cannot complete a navigation task."""


class TooNearError(NavigationError):
    """A start or a goal is nearer to an obstacle than the safety distance."""


class RecordingError(RadarsimError):
    """A recording cannot be written, read, or repeated."""


class SweepError(RadarsimError):
    """A sweep file is invalid, or a sweep cannot run, for example without workers."""


class MissingPackage(RadarsimError, ImportError):
    """An optional package is not installed; the message names the extra."""


def import_optional(name: str, extra: str) -> Any:
    """Import and return a module of an optional dependency.

    Args:
        name: Name of the module.
        extra: The extra of radarsim that installs the package of the module.

    Raises:
        MissingPackage: If the module is not installed; the message names the extra.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        text = f"{name.partition('.')[0]} is not installed, expected"
        raise MissingPackage(f"{text}: {install_command(extra)}") from error


def install_command(extra: str) -> str:
    """Return the pip command that installs an extra, and the folder to run it in."""
    pip = Path(sysconfig.get_path("scripts"), "pip")
    with suppress(OSError, ValueError):  # raised if pip is not in the current folder
        pip = pip.relative_to(Path.cwd())
    command = f"{shlex.quote(str(pip))} install '.[{extra}]'"
    return f"{command} in the checkout of radarsim"


def expected_one_of(name: object, known: Collection[str]) -> str:
    """Return the message for an unknown name: a similar name, and all known names.

    Args:
        name: The unknown name; values of other types than text are converted.
        known: The valid names, in the order in which the message lists them.

    >>> expected_one_of("sqare", ["circle", "square"])
    "'sqare' (did you mean 'square'?), expected one of ['circle', 'square']"
    >>> expected_one_of("line", ["circle", "square"])
    "'line', expected one of ['circle', 'square']"
    """
    text = str(name)
    meant = did_you_mean(text, known)  # placed before the list, which may be long
    return f"{text[:MAX_LENGTH]!r}{meant}, expected one of {list_names(known)}"


def list_names(names: Collection[str]) -> str:
    """Format names for a message: the first ``MAX_NAMES``, and the number of others.

    >>> list_names(["circle", "square"])
    "['circle', 'square']"
    """
    first = [name[:MAX_LENGTH] for name in islice(names, MAX_NAMES)]
    more = len(names) - len(first)
    return f"{first} and {more} more" if more else f"{first}"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the text "(did you mean ...?)" for an unknown name; "" if none is similar.

    The comparison ignores case and is limited to the first ``MAX_NAMES`` names.

    >>> did_you_mean("RADRA", ["laser", "radar"])
    " (did you mean 'radar'?)"
    """
    names = {each.casefold(): each for each in islice(known, MAX_NAMES)}
    wanted = name[:MAX_LENGTH].casefold()
    similar = get_close_matches(wanted, names, n=1, cutoff=CUTOFF)
    return f" (did you mean {names[similar[0]]!r}?)" if similar else ""


def describe_os_error(error: OSError | UnicodeError) -> str:
    """Return the reason of a system error as text that can follow a colon.

    UnicodeError is accepted too, since invalid host names raise it.

    >>> describe_os_error(PermissionError(13, "Permission denied", "map.yaml"))
    'no permission'
    """
    if isinstance(error, (socket.gaierror, UnicodeError)):
        return "unknown host name"
    number = error_number(error)
    if number in _WORDS:
        return _WORDS[number]
    if isinstance(error, TimeoutError):
        number = errno.ETIMEDOUT  # since asyncio's TimeoutError has no number
    text = os.strerror(number) if number > 0 else str(error)
    return text[:1].lower() + text[1:]


def join_address(host: str, port: int) -> str:
    """Return ``host:port``, with brackets around a host that contains colons.

    >>> join_address("::1", 3000)
    '[::1]:3000'
    """
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def error_number(error: OSError) -> int:
    """Return the errno of a system error; 0 if the error has none.

    If connections to several addresses of a host fail, asyncio raises one error without
    a number; then the number of the first attempt is returned.
    """
    if error.errno is not None:
        return error.errno
    found = re.search(r"\[Errno (\d+)\]", str(error))
    return int(found[1]) if found else 0
