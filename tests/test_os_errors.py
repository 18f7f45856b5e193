import errno
import os
import socket
from pathlib import Path

import pytest

from radarsim.errors import describe_os_error


@pytest.mark.parametrize("number", sorted(errno.errorcode))
def test_no_number_of_an_error_is_shown(number: int) -> None:
    text = describe_os_error(OSError(number, os.strerror(number), "file"))
    assert text
    assert "rrno" not in text
    assert not text[0].isupper()  # it follows a colon


def test_errors_without_a_permission_have_one_wording() -> None:
    words = {describe_os_error(OSError(n, "")) for n in (errno.EACCES, errno.EPERM)}
    assert words == {"no permission"}


def test_the_attempts_that_asyncio_joins_are_told_by_the_first() -> None:
    error = OSError(
        "Multiple exceptions: [Errno 111] Connect call failed ('::1', 9, 0, 0),"
        " [Errno 111] Connect call failed ('127.0.0.1', 9)"
    )
    alone = ConnectionRefusedError(errno.ECONNREFUSED, "Connection refused")
    assert describe_os_error(error) == describe_os_error(alone)


def test_other_errors_are_described() -> None:
    assert "name" in describe_os_error(socket.gaierror(-2, "Name or service not known"))
    assert "name" in describe_os_error(UnicodeError("label empty or too long"))
    assert "time" in describe_os_error(TimeoutError())
    assert describe_os_error(OSError("Odd")) == "odd"
    with pytest.raises(FileNotFoundError) as missing:
        Path("/no/such/file").read_bytes()
    assert describe_os_error(missing.value) == "no such file or folder"
