import pytest
from starlette.datastructures import Headers

from radarsim.server.web_server import AllowedHosts, is_token, make_token


def admits(
    allowed: AllowedHosts, *, needs_origin: bool = False, **headers: str
) -> bool:
    return allowed.admit(Headers(headers), needs_origin=needs_origin)


@pytest.mark.parametrize(
    ("address", "port", "inside", "outside"),
    [
        pytest.param(
            "127.0.0.1",
            8000,
            ["127.0.0.1:8000", "localhost:8000", "LOCALHOST:8000", "[::1]:8000"],
            [
                "evil.example:8000",
                "127.0.0.1:8001",
                "127.0.0.1",
                "localhost.evil.example:8000",
                "192.0.2.1:8000",
                "",
            ],
            id="names of this machine",
        ),
        pytest.param(
            "192.0.2.1", 8000, ["192.0.2.1:8000"], ["192.0.2.2:8000"], id="own address"
        ),
        *(
            pytest.param(
                every,
                8000,
                ["192.0.2.1:8000", "[2001:db8::1]:8000", "localhost:8000"],
                ["evil.example:8000", "192.0.2.1:80", "192.0.2.1", "[::1]"],
                id=f"all addresses but no names, {every}",
            )
            for every in ("0.0.0.0", "::")
        ),
        pytest.param(
            "0.0.0.0",
            80,
            ["127.0.0.1", "localhost", "192.0.2.1", "[::1]", "[2001:db8::1]:80"],
            ["evil.example", ""],
            id="browsers leave out port 80",
        ),
    ],
)
def test_hosts_that_come_in(
    address: str, port: int, inside: list[str], outside: list[str]
) -> None:
    allowed = AllowedHosts(address, port)
    assert [host for host in inside if admits(allowed, host=host)] == inside
    assert [host for host in outside if admits(allowed, host=host)] == []
    same = [
        host for host in inside if admits(allowed, host=host, origin=f"http://{host}")
    ]
    assert same == inside


def test_request_has_one_host() -> None:
    allowed = AllowedHosts("127.0.0.1", 8000)
    assert not admits(allowed)
    pairs = [(b"host", b"127.0.0.1:8000"), (b"host", b"evil.example")]
    assert not allowed.admit(Headers(raw=pairs), needs_origin=False)


@pytest.mark.parametrize(
    "origin",
    [
        "http://localhost:8000",  # it is not the host that is asked
        "https://127.0.0.1:8000",
        "http://evil.example",
        "null",
    ],
)
def test_origin_has_to_be_the_host(origin: str) -> None:
    allowed = AllowedHosts("127.0.0.1", 8000)
    assert not admits(allowed, host="127.0.0.1:8000", origin=origin)


def test_socket_without_origin_does_not_come_in() -> None:
    allowed = AllowedHosts("127.0.0.1", 8000)
    assert not admits(allowed, host="127.0.0.1:8000", needs_origin=True)


def test_tokens_differ_and_are_compared() -> None:
    token = make_token()
    assert len(token) >= 32
    assert token != make_token()
    assert is_token(token, token)
    assert not is_token(token[:-1], token)
    assert not is_token("ä", token)
