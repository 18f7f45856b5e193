import errno
import os
import pickle
import socket
from pathlib import Path

import pytest

from radarsim.errors import MapError, describe_os_error, did_you_mean, expected_one_of

NAMES = ["foliage_room", "smoke_room", "empty_room"]


def test_a_similar_name_is_suggested_before_the_list() -> None:
    text = expected_one_of("foliage_rom", NAMES)
    meant = "(did you mean 'foliage_room'?)"
    assert text == f"'foliage_rom' {meant}, expected one of {NAMES}"


@pytest.mark.parametrize("name", ["castle", "", "_"])
def test_nothing_is_suggested_for_a_name_like_none(name: str) -> None:
    assert expected_one_of(name, NAMES) == f"{name!r}, expected one of {NAMES}"


def test_upper_and_lower_case_are_equal() -> None:
    assert "'smoke_room'" in did_you_mean("SMOKE_ROM", NAMES)


def test_only_the_start_of_an_endless_name_is_shown() -> None:
    assert len(expected_one_of("x" * 10_000, NAMES)) < 200


def test_map_error_survives_pickling() -> None:
    error = pickle.loads(pickle.dumps(MapError(["a: bad", "b: worse"])))
    assert isinstance(error, MapError)
    assert error.problems == ["a: bad", "b: worse"]
    assert str(error) == "a: bad\nb: worse"


@pytest.mark.parametrize("number", sorted(errno.errorcode))
def test_no_number_of_an_error_is_shown(number: int) -> None:
    text = describe_os_error(OSError(number, os.strerror(number), "file"))
    assert text
    assert "rrno" not in text
    assert not text[0].isupper()  # it follows a colon


def test_errors_without_a_permission_have_one_wording() -> None:
    words = {describe_os_error(OSError(n, "")) for n in (errno.EACCES, errno.EPERM)}
    assert words == {"no permission"}


def test_the_attempts_that_asyncio_joins_are_reported_by_the_first() -> None:
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
    assert describe_os_error(missing.value) == "no such file or directory"
