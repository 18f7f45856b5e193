"""Helpers for TCP servers: ports, socket options, open files and exit signals."""

import asyncio
import errno
import logging
import select
import signal
import socket
import sys
import threading
from collections.abc import Awaitable, Callable, Iterable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, ParamSpec, TypeVar

from radarsim.errors import (
    PortUnavailable,
    ServerError,
    describe_os_error,
    error_number,
    join_address,
)
from radarsim.processes import (
    HUNG_UP,
    INTERRUPTED,
    is_ignored,
    signal_handlers,
)

if sys.platform == "linux":
    import fcntl
    import termios

P = ParamSpec("P")
T = TypeVar("T")

OUT_OF_FILES = (errno.EMFILE, errno.ENFILE)
ACCEPT_LOG_INTERVAL = 10.0  # s between two lines in the log
ACCEPTED_AT_ONCE = 16  # connections accepted in one round of the event loop
MAX_WAITING = 128  # connections that may wait for acceptance, the backlog
# With keepalive, a peer that vanishes without closing is detected after two minutes.
KEEP_ALIVE = {"TCP_KEEPIDLE": 60, "TCP_KEEPINTVL": 10, "TCP_KEEPCNT": 6}  # s, s, times
SEND_BUFFER_BYTES = 131_072  # small, since buffered data is old when it arrives


@contextmanager
def signal_callbacks(
    numbers: Iterable[int], callback: Callable[[int], object]
) -> Iterator[None]:
    """Call a function in the running event loop when a signal arrives.

    Args:
        numbers: Numbers of the signals.
        callback: Called with the number of the signal.
    """
    loop = asyncio.get_running_loop()

    def handle(number: int, _: FrameType | None) -> None:
        with suppress(RuntimeError):  # the loop is closed
            loop.call_soon_threadsafe(callback, number)

    # loop.add_signal_handler is not used, since its removal restores the default
    # action, and a second signal would kill the process while it shuts down.
    with signal_handlers(dict.fromkeys(numbers, handle)):
        yield


@contextmanager
def exit_code_of_signal() -> Iterator[asyncio.Future[int]]:
    """Yield a future that the first exit signal completes with an exit code.

    Yields:
        A future of the exit code: 130 after SIGINT, 0 after SIGTERM, 129 after SIGHUP.
    """
    codes: dict[int, int] = {signal.SIGINT: INTERRUPTED, signal.SIGTERM: 0}
    if sys.platform != "win32" and not is_ignored(signal.SIGHUP):
        codes[signal.SIGHUP] = HUNG_UP
    exit_code: asyncio.Future[int] = asyncio.get_running_loop().create_future()

    def end(number: int) -> None:
        if not exit_code.done():
            exit_code.set_result(codes[number])

    with signal_callbacks(codes, end):
        yield exit_code


def check_port(address: str, port: int) -> None:
    """Check that a port is free, so that a server fails before a slow start.

    Other errors, such as an address of another machine, are only found by ``listen``.

    Args:
        address: Address to listen on, or several addresses separated by commas.
        port: Port to listen on; 0, for a free port, always passes.

    Raises:
        PortUnavailable: If the port is in use, or reserved.
    """
    if not port:
        return
    for each in address.split(","):
        _check_places(each, port)


def _check_places(address: str, port: int) -> None:
    with suppress(OSError, UnicodeError):
        for family, *_, place in _places(address, port):
            try:
                _bind(family, place, only_ipv6=True).close()  # as in ``listen``
            except OSError as error:
                failure = _listening_error(error, address, port)
                if isinstance(failure, PortUnavailable):
                    raise failure from error


def bind(address: str, port: int, *, only_ipv6: bool = False) -> socket.socket:
    """Return a TCP socket that is bound to an address but does not listen yet.

    Args:
        address: Address to listen on; the first address of a host name.
        port: Port to listen on; 0 for a free port.
        only_ipv6: Whether ``::`` excludes IPv4 addresses (IPV6_V6ONLY).

    Raises:
        PortUnavailable: If the port is in use, or reserved.
        ServerError: If the address does not belong to this machine.
    """
    try:
        family, *_, place = _places(address, port)[0]
        return _bind(family, place, only_ipv6=only_ipv6)
    except (OSError, UnicodeError) as error:
        raise _listening_error(error, address, port) from error


def _places(address: str, port: int) -> list[tuple[Any, ...]]:
    kind, flags = socket.SOCK_STREAM, socket.AI_PASSIVE
    return [*socket.getaddrinfo(address, port, type=kind, flags=flags)]


def _bind(family: int, place: Any, *, only_ipv6: bool) -> socket.socket:
    bound = socket.socket(family, socket.SOCK_STREAM)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if only_ipv6 and family == socket.AF_INET6:
            bound.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        bound.bind(place)
    except OSError:
        bound.close()
        raise
    return bound


async def listen(
    protocol_factory: Callable[[], asyncio.BaseProtocol], address: str, port: int
) -> tuple[asyncio.Server, tuple[str, int]]:
    """Listen for TCP clients on an address and a port.

    Args:
        protocol_factory: Creates the protocol of a connection.
        address: Address to listen on, or several addresses separated by commas.
        port: Port to listen on at all addresses; 0 for a free port.

    Returns:
        The listening server, and the first host and the port that it listens on.

    Raises:
        PortUnavailable: If the port is in use, or reserved.
        ServerError: If the address does not belong to this machine.
    """
    loop = asyncio.get_running_loop()
    addresses = address.split(",")
    if not port and len(addresses) > 1:  # asyncio would use a different port for each
        with bind(addresses[0], 0) as free:
            port = free.getsockname()[1]
    try:
        listener = await loop.create_server(
            protocol_factory,
            addresses,
            port,
            reuse_address=True,
            # asyncio accepts up to ``backlog`` connections in one round of its event
            # loop; with a large value, many new connections would delay ticks.
            backlog=ACCEPTED_AT_ONCE,
        )
    except (OSError, UnicodeError) as error:
        raise _listening_error(error, address, port) from error
    if not listener.sockets:
        raise ServerError(f"cannot listen on {_join(address, port)}: no usable socket")
    for listening in listener.sockets:
        with listening.dup() as same:  # to set the backlog of the kernel separately
            same.listen(MAX_WAITING)
    places = [each.getsockname()[:2] for each in listener.sockets]  # unordered
    places.sort(key=lambda place: place[0] != addresses[0])
    host, bound_port = places[0]
    return listener, (host, bound_port)


def log_refused_accepts(log: logging.Logger) -> None:
    """Log one line if too many open files keep the event loop from accepting clients.

    Without this handler, asyncio logs a traceback every second.
    """
    loop = asyncio.get_running_loop()
    next_line = 0.0

    def handle(_: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        nonlocal next_line
        error = context.get("exception")
        if not isinstance(error, OSError) or error.errno not in OUT_OF_FILES:
            loop.default_exception_handler(context)
        elif loop.time() >= next_line:
            next_line = loop.time() + ACCEPT_LOG_INTERVAL
            text = "new clients wait for others to end: %s; 'ulimit -n' shows the limit"
            log.warning(text, describe_os_error(error))

    loop.set_exception_handler(handle)


def _listening_error(
    error: OSError | UnicodeError, address: str, port: int
) -> ServerError:
    text = f"cannot listen on {_join(address, port)}: {describe_os_error(error)}"
    number = error_number(error) if isinstance(error, OSError) else 0
    of_port = number in (errno.EADDRINUSE, errno.EACCES)
    return PortUnavailable(text, port) if of_port else ServerError(text)


def _join(addresses: str, port: int) -> str:
    return " and ".join(join_address(each, port) for each in addresses.split(","))


def configure_socket(transport: asyncio.BaseTransport) -> None:
    """Enable TCP keepalive on a socket, and set a small send buffer."""
    sock = transport.get_extra_info("socket")
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in KEEP_ALIVE.items():
        if hasattr(socket, name):  # Some systems lack these options.
            sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)
    # With a large buffer, a slow reader would be detected only after seconds, and would
    # receive old data.
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)


def waiting_bytes(transport: asyncio.BaseTransport) -> int:
    """Return how many received bytes wait to be read; 0 if the number is unknown."""
    if sys.platform != "linux":
        return 0
    number = transport.get_extra_info("socket").fileno()
    found = fcntl.ioctl(number, termios.FIONREAD, bytes(4))
    return int.from_bytes(found, sys.byteorder)


def find_hung_up(numbers: Iterable[int]) -> list[tuple[int, bool]]:
    """Return the sockets whose peers stopped sending, and whether each peer is gone.

    asyncio does not report this while reading from a transport is paused. The list is
    empty on systems other than Linux.

    Args:
        numbers: File descriptors of the sockets.
    """
    if sys.platform != "linux":
        return []
    poller = select.poll()
    for number in numbers:
        poller.register(number, select.POLLRDHUP)
    gone = select.POLLHUP | select.POLLERR  # poll always reports these events
    return [(number, bool(event & gone)) for number, event in poller.poll(0)]


def peer_name(transport: asyncio.BaseTransport) -> str:
    """Return address and port of a peer, for the log; ``?`` if they are unknown."""
    peer = transport.get_extra_info("peername")
    return f"{peer[0]}:{peer[1]}" if isinstance(peer, tuple) else "?"


def raise_file_limit(count: int) -> int:
    """Raise the limit of open files of this process, as far as the system permits.

    The limit is never lowered.

    Args:
        count: Required number of files and sockets.

    Returns:
        The permitted number of files, at most ``count``.
    """
    try:
        import resource  # noqa: PLC0415 - Windows has neither the module nor the limit
    except ImportError:
        return count
    limit, ceiling = resource.getrlimit(resource.RLIMIT_NOFILE)
    if limit == resource.RLIM_INFINITY:
        return count
    wanted = count if ceiling == resource.RLIM_INFINITY else min(count, ceiling)
    if limit < wanted:
        with suppress(ValueError, OSError):  # macOS permits less than it reports
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, ceiling))
            limit = wanted
    return min(count, limit)


async def first_of(*work: Awaitable[Any]) -> Any:
    """Run awaitables until one ends, and return its result or raise its error.

    The other awaitables are cancelled and awaited. If several end at the same time, the
    first in order counts.
    """
    tasks = [asyncio.ensure_future(each) for each in work]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    return next(task for task in tasks if task in done).result()


async def in_daemon_thread(
    function: Callable[P, T], *args: P.args, **kwargs: P.kwargs
) -> T:
    """Call a function in a daemon thread, and return its result."""
    future: Future[T] = Future()
    # A future marked as running cannot be cancelled, just as a call in a thread.
    future.set_running_or_notify_cancel()

    def run() -> None:
        try:
            future.set_result(function(*args, **kwargs))
        except Exception as error:  # noqa: BLE001 - raised in the awaiting task
            future.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    return await asyncio.wrap_future(future)
