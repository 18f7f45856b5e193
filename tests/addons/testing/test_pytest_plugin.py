"""The plugin, used by suites of strangers in processes of their own."""

import os
import resource
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest

from radarsim.addons.testing import UsarsimClient, UsarsimServer, make_thread

pytest_plugins = ["pytester"]

STRICT_INI = """
[pytest]
addopts = --strict-markers --strict-config -p no:randomly
filterwarnings = error
asyncio_mode = auto
asyncio_default_fixture_loop_scope = function
"""


NO_LEFTOVERS = """
import gc, threading
import pytest

@pytest.fixture(autouse=True)
def no_leftovers():
    before = threading.enumerate()
    yield
    gc.collect()  # a socket that is still open warns, and warnings are errors
    assert threading.enumerate() == before
"""

CLIENT_SUITE = '''
import asyncio
import socket
import pytest

INIT = "INIT {ClassName USARBot.P3AT} {Start RobotStart1}"

def scan(client):
    return client.read_until("SEN", "{Type RangeScanner}").partition("{Range ")[2]

def seconds(client):
    line = client.read_until("STA")
    return float(line.partition("{Time ")[2].partition("}")[0])

def test_a_plain_socket_is_greeted(usarsim_server):
    with socket.create_connection(usarsim_server.address, 5) as client:
        assert b"{Level DM-EmptyRoom}" in client.makefile("rb").readline()

async def test_the_loop_of_an_asynchronous_test_is_free(usarsim_server):
    reader, writer = await asyncio.open_connection(
        usarsim_server.host, usarsim_server.port
    )
    writer.write(INIT.encode() + b"\\r\\n")
    assert (await reader.readline()).startswith(b"NFO")
    assert (await asyncio.wait_for(reader.readline(), 5)).startswith(b"STA")
    writer.close()
    await writer.wait_closed()

def test_nothing_is_swallowed(usarsim_client):
    assert usarsim_client.read_line().startswith("NFO {Gametype BotDeathMatch}")
    usarsim_client.send("GETSTARTPOSES")
    assert usarsim_client.read_line().startswith("NFO {StartPoses 3}")

def test_a_client_of_a_server_goes_first(usarsim_client, usarsim_server):
    usarsim_client.send(INIT)
    with socket.create_connection(usarsim_server.address, 5) as other:
        other.sendall(INIT.encode())
        assert scan(usarsim_client).count(",") == 180

@pytest.mark.parametrize("run", [1, 2])
def test_every_server_is_fresh(usarsim_client, run):
    usarsim_client.send(INIT + " {Name R}")
    assert seconds(usarsim_client) < 10

@pytest.mark.usarsim(map="foliage_room")
class TestMarks:
    drawn = []

    def test_map_of_the_class(self, usarsim_client):
        assert "DM-FoliageRoom" in usarsim_client.read_line()

    @pytest.mark.usarsim(map="smoke_room")
    def test_the_nearest_mark_counts(self, usarsim_client):
        assert "DM-SmokeRoom" in usarsim_client.read_line()

    @pytest.mark.parametrize("seed", [
        pytest.param(seed, marks=pytest.mark.usarsim(seed=seed)) for seed in (1, 1, 2)
    ])
    def test_draw(self, usarsim_client, seed):
        usarsim_client.send(INIT)
        self.drawn.append(scan(usarsim_client))

    def test_a_seed_draws_the_same_again(self):
        assert self.drawn[0] == self.drawn[1] != self.drawn[2]

    @pytest.mark.usarsim(speed=20)
    def test_speed(self, usarsim_client):
        usarsim_client.send(INIT)
        first = seconds(usarsim_client)
        for _ in range(400):
            last = seconds(usarsim_client)
        assert last - first == pytest.approx(40)

    @pytest.mark.usarsim(dialect="udk")
    def test_dialect(self, usarsim_client):
        usarsim_client.send(INIT)
        usarsim_client.send("GETCONF {Type Robot}")
        assert "{MaxSpeed 1.2999}" in usarsim_client.read_until("CONF")

    @pytest.mark.usarsim(settings={"lms200": {"max_range": 5}})
    def test_settings(self, usarsim_client):
        usarsim_client.send(INIT)
        assert scan(usarsim_client).startswith("5.00,5.00,")

class TestOwnMap:
    @pytest.fixture
    def usarsim_map(self, tmp_path):
        path = tmp_path / "shed.yaml"
        path.write_text("""
version: 1
materials: {wood: {density: opaque}}
objects:
  - {name: wall, box: [1, 1, 1], material: wood, position: [9, 0, 0.5]}
""")
        return path

    def test_a_file_of_the_suite(self, usarsim_client):
        assert "{Level shed}" in usarsim_client.read_line()

    @pytest.mark.usarsim(map="empty_room")
    def test_a_mark_is_nearer(self, usarsim_client):
        assert "DM-EmptyRoom" in usarsim_client.read_line()
'''


@pytest.mark.slow
def test_suite_of_a_client_passes_with_warnings_as_errors(
    pytester: pytest.Pytester,
) -> None:
    pytester.makeini(STRICT_INI)
    pytester.makeconftest(NO_LEFTOVERS)
    pytester.makepyfile(CLIENT_SUITE)
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider")
    result.assert_outcomes(passed=17)


@pytest.mark.slow
def test_server_that_cannot_start_fails_the_setup_with_one_line(
    pytester: pytest.Pytester,
) -> None:
    pytester.makeini(STRICT_INI)
    pytester.makepyfile(
        """
        import pytest

        @pytest.mark.parametrize("nothing", [
            pytest.param(0, marks=pytest.mark.usarsim(**options)) for options in (
                {"map": "forest"}, {"seed": -1}, {"speed": 0}, {"dialect": "ude"},
                {"settings": {"lms201": {"max_range": 5}}}, {"sed": 1},
                {"speed": "fast"}, {"seed": 1.5}, {"map": 3}, {"dialect": None},
                {"settings": {"lms200": 5}}, {"settings": "max_range=5"},
            )
        ])
        def test(usarsim_server, nothing):
            pass

        @pytest.mark.usarsim("forest")
        def test_no_keyword(usarsim_server):
            pass
        """
    )
    result = pytester.runpytest_subprocess()
    result.assert_outcomes(errors=13)
    start = "usarsim_server cannot start: "
    result.stdout.fnmatch_lines(
        [
            f"{start}forest: no such file*, expected a map file or one of *empty_room*",
            f"{start}seed: -1, expected at least 0",
            f"{start}speed: 0, expected more than 0",
            f"{start}dialect: 'ude'*, expected 'compat' or 'udk'",
            f"{start}item 'lms201'*, expected one of *",
            f"{start}no setting 'sed' (did you mean 'seed'?), expected one of *",
            f"{start}speed: 'fast', expected a number",
            f"{start}seed: 1.5, expected a whole number",
            f"{start}map*: 3, expected text",
            f"{start}dialect: None, expected 'compat' or 'udk'",
            f"{start}settings.lms200: 5, expected keys with values",
            f"{start}settings: 'max_range=5', expected keys with values",
            f"{start}mark usarsim('forest',), expected keyword arguments",
        ]
    )
    result.stdout.no_fnmatch_line("*another exception*")


@pytest.mark.slow
def test_error_in_the_server_thread_fails_its_test(
    pytester: pytest.Pytester,
) -> None:
    pytester.makeini(STRICT_INI)
    pytester.makeconftest(NO_LEFTOVERS)
    pytester.makepyfile(
        """
        import pytest
        from radarsim.server.host import Host

        def broken(*arguments, **keywords):
            raise ZeroDivisionError("a bug")

        @pytest.fixture(params=["step", "receive"])
        def bug(request, monkeypatch):
            monkeypatch.setattr(Host, request.param, broken)

        def test(bug, usarsim_client):
            usarsim_client.send("INIT {ClassName USARBot.P3AT}")
            usarsim_client.read_until("STA")
        """
    )
    result = pytester.runpytest_subprocess()
    result.assert_outcomes(failed=2, errors=2)
    result.stdout.fnmatch_lines(["*ExceptionGroup: usarsim_server failed*"])
    result.stdout.fnmatch_lines(["*ZeroDivisionError: a bug*"] * 2)
    result.stdout.fnmatch_lines(["*Connection*"] * 2)


@pytest.mark.slow
def test_suites_without_a_server_do_not_import_it(
    pytester: pytest.Pytester,
) -> None:
    pytester.makeini(STRICT_INI)
    pytester.makepyfile(
        """
        import sys

        def test():
            assert "radarsim.addons.testing" in sys.modules
            assert not {"radarsim.server.host", "shapely"} & sys.modules.keys()
        """
    )
    pytester.runpytest_subprocess().assert_outcomes(passed=1)


def test_the_marker_is_listed(pytester: pytest.Pytester) -> None:
    result = pytester.runpytest_subprocess("--markers")
    result.stdout.fnmatch_lines(["@pytest.mark.usarsim(map='empty_room', *"])


@contextmanager
def files_left(count: int) -> Iterator[None]:
    """Let the process open only so many more files and sockets."""
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    taken: list[int] = []
    highest = max(map(int, os.listdir("/proc/self/fd")))  # noqa: PTH208
    resource.setrlimit(resource.RLIMIT_NOFILE, (highest + 8, before[1]))
    try:
        with suppress(OSError):
            while True:
                taken.append(os.open(os.devnull, os.O_RDONLY))
        for _ in range(count):
            os.close(taken.pop())
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
        for file in taken:
            os.close(file)


def test_start_fails_when_no_socket_is_left() -> None:
    thread = make_thread({"map": "empty_room"})
    with files_left(3), pytest.raises(ExceptionGroup, match="usarsim_server failed"):
        thread.begin()  # the loop takes three
    assert not thread.is_alive()


def test_server_thread_stops_while_clients_are_connected() -> None:
    thread = make_thread({"map": "empty_room"})
    server = UsarsimServer(*thread.begin())
    clients = [UsarsimClient(server.address) for _ in range(10)]
    for client in clients:
        client.send("INIT {ClassName USARBot.P3AT} {Location 0,0,0}")
    clients[0].read_until("STA")
    thread.finish()
    assert not thread.is_alive()
    for client in clients:
        client.close()
    with pytest.raises(ConnectionRefusedError):
        UsarsimClient(server.address)


@pytest.fixture
def peer() -> Iterator[tuple[socket.socket, UsarsimClient]]:
    """Give a client and the other end of its connection."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        client = UsarsimClient(listener.getsockname())
        end, _ = listener.accept()
        with end:
            yield end, client
        client.close()


Peer = tuple[socket.socket, UsarsimClient]


def test_incomplete_line_is_kept_for_the_next_read(peer: Peer) -> None:
    end, client = peer
    end.sendall(b"STA {A 1}\r\nSEN {B")
    assert client.read_line() == "STA {A 1}"
    with pytest.raises(TimeoutError, match=r"^no complete line in time, received"):
        client.read_line(timeout=0)
    end.sendall(b" 2}\r\n")
    assert client.read_line() == "SEN {B 2}"


def test_read_until_returns_the_first_line_with_all_parts(peer: Peer) -> None:
    end, client = peer
    end.sendall(b"STA {A 1}\r\nSEN {A 2}\r\nSEN {B 3} {A 1}\r\nSTA {C 4}\r\n")
    assert client.read_until("SEN", "{A 1}", "{B 3}") == "SEN {B 3} {A 1}"
    expected = r"^no 'SEN {B 2}' within 0.05 s, the last line was 'STA {C 4}'$"
    with pytest.raises(TimeoutError, match=expected):
        client.read_until("SEN", "{B 2}", timeout=0.05)


def test_other_lines_do_not_extend_the_timeout(peer: Peer) -> None:
    end, client = peer
    ended = threading.Event()

    def chatter() -> None:
        while not ended.is_set():
            with suppress(ConnectionError):
                end.sendall(b"STA {A 1}\r\n" * 100)

    thread = threading.Thread(target=chatter)
    thread.start()
    try:
        began = time.monotonic()
        with pytest.raises(TimeoutError, match=r"no 'SEN' within 0\.1 s"):
            client.read_until("SEN", timeout=0.1)
        assert time.monotonic() - began < 240
    finally:
        ended.set()
        client.close()
        thread.join()


def test_closed_connection_is_a_connection_error(peer: Peer) -> None:
    end, client = peer
    end.close()
    with pytest.raises(ConnectionError, match="the server has closed the connection"):
        client.read_line()


def test_line_is_sent_with_crlf_and_has_no_line_end_itself(peer: Peer) -> None:
    end, client = peer
    for line in ("DRIVE\r\n", "A\nB", "\r"):
        with pytest.raises(ValueError, match="expected no line break in it"):
            client.send(line)
    client.send("DRIVE {Left 1}")
    assert end.recv(100) == b"DRIVE {Left 1}\r\n"
