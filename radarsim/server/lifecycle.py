"""What runs in the foreground: it listens on a port until a signal ends it."""

import asyncio
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Final

from radarsim.errors import ServerError

CODES: Final = {signal.SIGINT: 130, signal.SIGTERM: 0}


@contextmanager
def exit_code_of_signal() -> Iterator[asyncio.Future[int]]:
    """Have signals that would end the process end a wait in the loop instead.

    Yields:
        The exit code, once the first signal has come: 130 after an interrupt, 0 after
        a request to terminate.
    """
    loop = asyncio.get_running_loop()
    ended: asyncio.Future[int] = loop.create_future()

    def end(code: int) -> None:
        if not ended.done():
            ended.set_result(code)

    def calls(code: int) -> Callable[[int, FrameType | None], None]:
        def handle(_number: int, _frame: FrameType | None) -> None:
            with suppress(RuntimeError):  # the loop is closed
                loop.call_soon_threadsafe(end, code)

        return handle

    # Not the loop's own handlers: these leave none behind, and a second signal would
    # kill the process while it ends.
    before = {
        number: signal.signal(number, calls(code)) for number, code in CODES.items()
    }
    try:
        yield ended
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


async def listen(
    expect: Callable[[], asyncio.BaseProtocol], address: str, port: int
) -> tuple[asyncio.Server, tuple[str, int]]:
    """Listen for clients.

    Args:
        expect: Makes what talks with the next one.
        address: To listen on.
        port: 0 for a free one.

    Returns:
        What listens, and the host and port that it does so on.

    Raises:
        ServerError: If the port is taken, or the address is none of ours.
    """
    loop = asyncio.get_running_loop()
    try:
        listener = await loop.create_server(expect, address, port, reuse_address=True)
    except OSError as error:
        number = error.errno or 0  # asyncio says the address again in strerror
        reason = os.strerror(number) if number > 0 else error.strerror or error
        text = f"cannot listen on {address}:{port}: {reason}"
        raise ServerError(text) from error
    if not listener.sockets:
        raise ServerError(f"cannot listen on {address}:{port}: no socket to be had")
    host, number = listener.sockets[0].getsockname()[:2]
    return listener, (host, number)
