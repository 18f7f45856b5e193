"""Bridges of ROS that run in a thread of a test, or in a process."""

import asyncio
import queue
import threading
from collections.abc import Coroutine, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from processes import start_radarsim

from radarsim.addons.ros.board import Board
from radarsim.addons.ros.bridge import run_bridge
from radarsim.addons.ros.cli import TopicOptions
from radarsim.addons.ros.websocket_side import WebSocketSide
from radarsim.addons.testing import UsarsimServer

TIMEOUT = 240  # s that a busy machine may need


@contextmanager
def running(work: Coroutine[Any, Any, None]) -> Iterator[None]:
    """Run a coroutine in a thread of its own, and cancel it at the end.

    Raises:
        Exception: That of the coroutine, if it has failed before.
    """
    loop = asyncio.new_event_loop()
    task = loop.create_task(work)
    waiting = asyncio.wait({task})
    thread = threading.Thread(target=loop.run_until_complete, args=[waiting])
    thread.start()
    try:
        yield
    finally:
        loop.call_soon_threadsafe(task.cancel)
        thread.join(TIMEOUT)
        loop.close()
        with suppress(asyncio.CancelledError):
            task.result()


@contextmanager
def serving(
    board: Board, server: UsarsimServer | None = None, **options: Any
) -> Iterator[int]:
    """Serve a board, and yield its port.

    Args:
        board: The board.
        server: The server whose robots it publishes; None for none.
        options: ``robot_class`` and ``origins``; all others are of ``TopicOptions``.
    """
    ports: queue.Queue[int] = queue.Queue()
    origins: Sequence[str] = options.pop("origins", ())
    side = WebSocketSide(
        board, "127.0.0.1", 0, lambda _, address: ports.put(address[1]), origins
    )
    robot_class = options.pop("robot_class", None)
    topics = TopicOptions(**options)
    work = (
        side.run()
        if server is None
        else run_bridge(server.address, side, options=topics, robot_class=robot_class)
    )
    with running(work):
        yield ports.get(timeout=TIMEOUT)


@contextmanager
def bridge(server: UsarsimServer, *options: str) -> Iterator[str]:
    """Run a bridge in a process of its own; yield what it prints first."""
    words = ("ros", "--connect", f"127.0.0.1:{server.port}", *options)
    with start_radarsim(*words) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().decode()
        finally:
            process.terminate()
            process.communicate(timeout=TIMEOUT)
