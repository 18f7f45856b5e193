"""Plain words for the errors of the operating system, the same ones everywhere."""

import errno
import os
import re
import socket
from typing import Final

_WORDS: Final = {
    errno.EACCES: "no permission",
    errno.EADDRINUSE: "the port is in use by another program",
    errno.EADDRNOTAVAIL: "no address of this machine",
    errno.ECONNABORTED: "the other side has closed the connection",
    errno.ECONNREFUSED: "nothing listens there",
    errno.ECONNRESET: "the other side has closed the connection",
    errno.EEXIST: "a file of that name",
    errno.EDQUOT: "the disk is full",
    errno.EFBIG: "the file would be too large",
    errno.EHOSTUNREACH: "there is no way to it",
    errno.EISDIR: "a folder of that name",
    errno.ELOOP: "links that lead back to themselves",
    errno.EMFILE: "too many open files",
    errno.ENAMETOOLONG: "the name is too long",
    errno.ENETUNREACH: "there is no way to it",
    errno.ENOENT: "no such file or folder",
    errno.ENOSPC: "the disk is full",
    errno.ENOTDIR: "no such folder",
    errno.EPERM: "no permission",
    errno.EPIPE: "the other side has closed the connection",
    errno.EROFS: "the disk is read-only",
    errno.ETIMEDOUT: "no answer in time",
}


def describe_os_error(error: OSError | UnicodeError) -> str:
    """Return the reason of an error in words that fit after a colon.

    Names of hosts that no resolver takes raise UnicodeError.

    >>> describe_os_error(PermissionError(13, "Permission denied", "map.yaml"))
    'no permission'
    """
    if isinstance(error, (socket.gaierror, UnicodeError)):
        return "no host of that name"
    number = error_number(error)
    if number in _WORDS:
        return _WORDS[number]
    if isinstance(error, TimeoutError):
        return _WORDS[errno.ETIMEDOUT]
    text = os.strerror(number) if number > 0 else str(error)
    return text[:1].lower() + text[1:]


def error_number(error: OSError) -> int:
    """Return the number of an error; 0 if it has none.

    asyncio reports the attempts to connect to several addresses of a host as one error
    without a number; it is then that of the first attempt.
    """
    if error.errno is not None:
        return error.errno
    found = re.search(r"\[Errno (\d+)\]", str(error))
    return int(found[1]) if found else 0
