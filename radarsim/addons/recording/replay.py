"""Play a recorded run to clients, or repeat it and compare it byte by byte."""

import asyncio
import logging
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import TypeAlias

from radarsim.addons.recording.host_recorder import EventType, RunEvent
from radarsim.errors import RecordingError
from radarsim.listening import exit_code_of_signal, listen, peer_name
from radarsim.server.host.host import Host
from radarsim.simulation.clock import seconds

log = logging.getLogger("radarsim.addons.recording")

SHOWN = 60  # characters of a line that differs


@dataclass(frozen=True, slots=True)
class Difference:
    """Where a repeated run first differs from the recorded one.

    Attributes:
        tick: Tick of simulated time.
        client: Number of the client.
        line: Number of the line among all that it was sent, from 1.
        byte: Number of the byte in the line, from 1.
        recorded: The line from a little before that byte on, as recorded; empty if
            there was none.
        repeated: Likewise, as it came now.
    """

    tick: int
    client: int
    line: int
    byte: int
    recorded: str
    repeated: str

    def __str__(self) -> str:
        place = f"tick {self.tick}, line {self.line}, byte {self.byte}"
        came = f"came {self.repeated!r}, expected {self.recorded!r}"
        return f"{place} of client {self.client}: {came}"


@dataclass(frozen=True, slots=True)
class Repetition:
    """How a run was repeated.

    Attributes:
        ticks: Ticks of simulated time.
        clients: Number of clients.
        bytes: Number of bytes that were equal.
        difference: The first difference; None if there is none.
    """

    ticks: int
    clients: int
    bytes: int
    difference: Difference | None


def repeat_run(host: Host, calls: Iterable[RunEvent]) -> Repetition:
    """Repeat a run up to the first difference.

    Args:
        host: A host of the recorded conditions, which has had no clients.
        calls: The recorded calls, in order.
    """
    tick = clients = equal = 0
    lines: Counter[int] = Counter()
    for call in calls:
        # Calls have the ticks before them, so that time passes as it did.
        while tick < call.tick:
            host.step()
            tick += 1
        if call.type is EventType.CONNECT:
            clients += 1
        sent = _repeat(host, call)
        if sent is None:
            continue
        if sent != call.data:
            difference = _difference(call, sent, lines[call.client])
            return Repetition(tick, clients, equal, difference)
        equal += len(sent)
        lines[call.client] += sent.count(b"\n")
    return Repetition(tick, clients, equal, None)


def _repeat(host: Host, call: RunEvent) -> bytes | None:
    """Repeat one call; return what the client is sent, None if it is sent nothing."""
    match call.type:
        case EventType.TAKE:
            return host.take(call.client)
        case EventType.FINISH:
            return host.finish(call.client)
        case EventType.RECEIVE:
            host.receive(call.client, call.data)
        case EventType.CONNECT:
            host.connect()
        case EventType.DISCONNECT:
            host.disconnect(call.client)
        case EventType.WAIT:
            for _ in range(call.client):  # ticks, no number of a client
                host.step(passes=False)
        case _:
            pass
    return None


def _difference(call: RunEvent, sent: bytes, lines_before: int) -> Difference:
    """Find the first byte that differs."""
    shorter = min(len(sent), len(call.data))
    equal = next((i for i in range(shorter) if sent[i] != call.data[i]), shorter)
    start = call.data.rfind(b"\n", 0, equal) + 1
    # Lines of scans have thousands of characters: only what is near is shown.
    shown = max(start, equal - SHOWN // 2)
    recorded, repeated = (
        data[shown : shown + SHOWN].split(b"\r")[0].decode("latin-1")
        for data in (call.data, sent)
    )
    return Difference(
        tick=call.tick,
        client=call.client,
        line=lines_before + call.data.count(b"\n", 0, start) + 1,
        byte=equal - start + 1,
        recorded=recorded,
        repeated=repeated,
    )


# The bytes of each write to a client, and the time since it connected, s.
Writes: TypeAlias = list[tuple[float, bytes]]


def writes_of(calls: Iterable[RunEvent], client: int | None) -> Writes:
    """Return what a client was sent.

    Args:
        calls: The recorded calls, in order.
        client: Number of the client; None for that which was sent most.

    Raises:
        RecordingError: If there is no such client.
    """
    starts: dict[int, int] = {}
    writes: dict[int, Writes] = {}
    for type_, tick, number, data in calls:
        if type_ is EventType.CONNECT:
            starts[number] = tick
            writes[number] = []
        elif type_ in (EventType.TAKE, EventType.FINISH) and data:
            writes[number].append((seconds(tick - starts[number]), data))
    if not writes:
        raise RecordingError("no client in the recording, expected at least one")
    if client is None:
        # Of clients that were sent as much, the first.
        client = max(writes, key=lambda n: (sum(len(d) for _, d in writes[n]), -n))
    elif client not in writes:
        numbers = ", ".join(map(str, sorted(writes)))
        raise RecordingError(f"client {client}, expected one of {numbers}")
    return writes[client]


class ReplayServer:
    """Plays what one client was sent to each client that connects.

    What these send is read and ignored. A client that reads too slowly gets everything
    later, as nothing is left out.
    """

    def __init__(self, writes: Writes, *, speed: float = 1.0) -> None:
        """Create a server that does not listen yet.

        Args:
            writes: What is played.
            speed: Recorded seconds in one second of real time.
        """
        self._writes = writes
        self._speed = speed

    async def serve(
        self,
        address: str,
        port: int,
        announce: Callable[[tuple[str, int]], None],
    ) -> int:
        """Serve until a signal comes.

        Args:
            address: Address to listen on.
            port: Port to listen on; 0 for a free one.
            announce: Called with the address as soon as clients can connect.

        Returns:
            The exit code of the signal.

        Raises:
            ServerError: If it cannot listen.
        """
        with exit_code_of_signal() as exit_code:
            listener, place = await listen(self._protocol, address, port)
            announce(place)
            try:
                return await exit_code
            finally:
                listener.close()

    def _protocol(self) -> asyncio.StreamReaderProtocol:
        return asyncio.StreamReaderProtocol(asyncio.StreamReader(), self._play)

    async def _play(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        """Play everything to one client."""
        peer = peer_name(writer.transport)
        log.info("%s: connected", peer)
        # A client whose commands nobody reads would block once the buffers are full.
        ignoring = asyncio.ensure_future(_ignore(reader))
        loop = asyncio.get_running_loop()
        start = loop.time()
        with suppress(OSError):
            for time, data in self._writes:
                # From the start, not from the last write: delays do not add up.
                await asyncio.sleep(start + time / self._speed - loop.time())
                if writer.is_closing():
                    break
                writer.write(data)
                # Waits for a client that reads slowly: nothing is left out for it.
                await writer.drain()
        ignoring.cancel()
        writer.close()
        log.info("%s: disconnected", peer)


async def _ignore(reader: asyncio.StreamReader) -> None:
    """Read what a client sends."""
    with suppress(OSError):
        while await reader.read(65536):
            pass
