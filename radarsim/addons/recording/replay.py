"""Play a recorded run to clients, or repeat it and compare it byte by byte."""

import asyncio
import logging
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import NamedTuple, TypeAlias

from radarsim.addons.recording.recorders import EventType, RunEvent
from radarsim.errors import RecordingError
from radarsim.listening import exit_code_of_signal, listen, peer_name
from radarsim.server.host.host import Host
from radarsim.simulation.clock import seconds

log = logging.getLogger("radarsim.addons.recording")

SHOWN = 60  # characters of a line that differs


class Repetition(NamedTuple):
    """How a run was repeated.

    Attributes:
        ticks: Ticks of simulated time.
        clients: Number of clients.
        bytes: Number of bytes that were equal.
        difference: The first difference: its place, what came and what was recorded;
            empty if there is none.
    """

    ticks: int
    clients: int
    bytes: int
    difference: str = ""


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
    return Repetition(tick, clients, equal)


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


def _difference(call: RunEvent, sent: bytes, lines_before: int) -> str:
    """Describe the first byte that differs."""
    shorter = min(len(sent), len(call.data))
    equal = next((i for i in range(shorter) if sent[i] != call.data[i]), shorter)
    start = call.data.rfind(b"\n", 0, equal) + 1
    # Lines of scans have thousands of characters: only the part around it is shown.
    shown = max(start, equal - SHOWN // 2)
    recorded, repeated = (
        data[shown : shown + SHOWN].split(b"\r")[0].decode("latin-1")
        for data in (call.data, sent)
    )
    line = lines_before + call.data.count(b"\n", 0, start) + 1
    place = f"tick {call.tick}, line {line}, byte {equal - start + 1}"
    came = f"came {repeated!r}, expected {recorded!r}"
    return f"{place} of client {call.client}: {came}"


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


async def serve_replay(
    writes: Writes,
    address: str,
    port: int,
    announce: Callable[[tuple[str, int]], None],
    *,
    speed: float = 1.0,
) -> int:
    """Play the writes to one client to each that connects, until a signal comes.

    Bytes of clients are read and ignored. A client that reads too slowly gets all of it
    later, as nothing is left out.

    Args:
        writes: The writes of the client that is played.
        address: Address to listen on.
        port: Port to listen on; 0 for a free one.
        announce: Called with the address as soon as clients can connect.
        speed: Recorded seconds in one second of real time.

    Returns:
        The exit code of the signal.

    Raises:
        ServerError: If it cannot listen.
    """

    async def play(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        peer = peer_name(writer.transport)
        log.info("%s: connected", peer)
        # A client whose commands nobody reads would block once the buffers are full.
        ignoring = asyncio.ensure_future(_ignore(reader))
        loop = asyncio.get_running_loop()
        start = loop.time()
        with suppress(OSError):
            for time, data in writes:
                # From the start, not from the last write: delays do not add up.
                await asyncio.sleep(start + time / speed - loop.time())
                if writer.is_closing():
                    break
                writer.write(data)
                # Waits for a client that reads slowly: nothing is left out for it.
                await writer.drain()
        ignoring.cancel()
        writer.close()
        log.info("%s: disconnected", peer)

    def protocol() -> asyncio.StreamReaderProtocol:
        return asyncio.StreamReaderProtocol(asyncio.StreamReader(), play)

    with exit_code_of_signal() as exit_code:
        listener, place = await listen(protocol, address, port)
        announce(place)
        try:
            return await exit_code
        finally:
            listener.close()


async def _ignore(reader: asyncio.StreamReader) -> None:
    """Read what a client sends."""
    with suppress(OSError):
        while await reader.read(65536):
            pass
