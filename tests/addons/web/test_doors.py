import pytest
from starlette.datastructures import Headers

from radarsim.server.web_server import Doors, is_token, make_token


def admits(doors: Doors, *, needs_origin: bool = False, **headers: str) -> bool:
    return doors.admit(Headers(headers), needs_origin=needs_origin)


@pytest.mark.parametrize(
    "host", ["127.0.0.1:8000", "localhost:8000", "LOCALHOST:8000", "[::1]:8000"]
)
def test_names_of_this_machine_come_in(host: str) -> None:
    assert admits(Doors("127.0.0.1", 8000), host=host)


@pytest.mark.parametrize(
    "host",
    [
        "evil.example:8000",
        "127.0.0.1:8001",
        "127.0.0.1",
        "localhost.evil.example:8000",
        "192.0.2.1:8000",
        "",
    ],
)
def test_other_hosts_do_not_come_in(host: str) -> None:
    assert not admits(Doors("127.0.0.1", 8000), host=host)


def test_request_without_host_does_not_come_in() -> None:
    assert not admits(Doors("127.0.0.1", 8000))


def test_request_with_two_hosts_does_not_come_in() -> None:
    pairs = [(b"host", b"127.0.0.1:8000"), (b"host", b"evil.example")]
    assert not Doors("127.0.0.1", 8000).admit(Headers(raw=pairs), needs_origin=False)


@pytest.mark.parametrize(
    ("origin", "expected"),
    [
        ("http://127.0.0.1:8000", True),
        ("http://localhost:8000", False),  # it is not the host that is asked
        ("https://127.0.0.1:8000", False),
        ("http://evil.example", False),
        ("null", False),
    ],
)
def test_origin_has_to_be_the_host(origin: str, expected: bool) -> None:
    doors = Doors("127.0.0.1", 8000)
    assert admits(doors, host="127.0.0.1:8000", origin=origin) is expected


def test_socket_without_origin_does_not_come_in() -> None:
    doors = Doors("127.0.0.1", 8000)
    assert not admits(doors, host="127.0.0.1:8000", needs_origin=True)


@pytest.mark.parametrize("address", ["0.0.0.0", "::"])
def test_where_all_addresses_are_served_hosts_are_addresses_and_no_names(
    address: str,
) -> None:
    doors = Doors(address, 8000)
    assert admits(doors, host="192.0.2.1:8000")
    assert admits(doors, host="[2001:db8::1]:8000")
    assert admits(doors, host="localhost:8000")
    assert not admits(doors, host="evil.example:8000")
    assert not admits(doors, host="192.0.2.1:80")


@pytest.mark.parametrize(
    "host", ["127.0.0.1", "localhost", "192.0.2.1", "[::1]", "[2001:db8::1]:80"]
)
def test_browsers_leave_out_port_80(host: str) -> None:
    assert admits(Doors("0.0.0.0", 80), host=host, origin=f"http://{host}")
    assert not admits(Doors("0.0.0.0", 8000), host=host)
    assert not admits(Doors("0.0.0.0", 80), host="evil.example")
    assert not admits(Doors("0.0.0.0", 80), host="")


def test_own_address_comes_in() -> None:
    assert admits(Doors("192.0.2.1", 8000), host="192.0.2.1:8000")


def test_tokens_differ_and_are_compared() -> None:
    token = make_token()
    assert len(token) >= 32
    assert token != make_token()
    assert is_token(token, token)
    assert not is_token(token[:-1], token)
    assert not is_token("ä", token)
