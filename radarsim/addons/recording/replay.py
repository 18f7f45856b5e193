"""Plays a recorded run to clients, or simulates it again and compares the bytes."""

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

SHOWN = 60  # characters of a differing line that a message quotes


class Repetition(NamedTuple):
    """The result of repeating a run.

    Attributes:
        ticks: Ticks of simulated time.
        clients: Number of clients.
        bytes: Number of equal bytes.
        difference: Position, repeated text and recorded text of the first difference;
            empty if there is none.
    """

    ticks: int
    clients: int
    bytes: int
    difference: str = ""


def repeat_run(host: Host, calls: Iterable[RunEvent]) -> Repetition:
    """Repeat a recorded run until its output differs from the recording.

    Args:
        host: A host with the recorded conditions, which has had no clients yet.
        calls: The recorded calls, in order.
    """
    tick = clients = equal = 0
    lines: Counter[int] = Counter()
    for call in calls:
        # The host is stepped up to the recorded tick of the call, so time passes as it
        # did in the recorded run.
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
    """Repeat a call; return the bytes for the client, None if the call sends none."""
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
            for _ in range(call.client):  # for WAIT, ``client`` is the number of ticks
                host.step(passes=False)
        case _:
            pass
    return None


def _difference(call: RunEvent, sent: bytes, lines_before: int) -> str:
    """Return a description of the first byte that differs."""
    shorter = min(len(sent), len(call.data))
    equal = next((i for i in range(shorter) if sent[i] != call.data[i]), shorter)
    start = call.data.rfind(b"\n", 0, equal) + 1
    # Scan lines have thousands of characters, so only text near the difference is
    # quoted.
    shown = max(start, equal - SHOWN // 2)
    recorded, repeated = (
        data[shown : shown + SHOWN].split(b"\r")[0].decode("latin-1")
        for data in (call.data, sent)
    )
    line = lines_before + call.data.count(b"\n", 0, start) + 1
    place = f"tick {call.tick}, line {line}, byte {equal - start + 1}"
    came = f"came {repeated!r}, expected {recorded!r}"
    return f"{place} of client {call.client}: {came}"


# Each write to a client: the time since the client connected, s, and the bytes.
Writes: TypeAlias = list[tuple[float, bytes]]


def writes_of(calls: Iterable[RunEvent], client: int | None) -> Writes:
    """Return the recorded writes to a client.

    Args:
        calls: The recorded calls, in order.
        client: Number of the client; None for the client that was sent most bytes.

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
        # If several clients received equally many bytes, the first of them is chosen.
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
    """Play the recorded writes to each client until the process gets a signal.

    Bytes from clients are read and ignored. A client that reads slowly gets the bytes
    later, but gets all of them.

    Args:
        writes: The writes of the client that is played.
        address: Address to listen on.
        port: Port to listen on; 0 for a free one.
        announce: Called with the address as soon as clients can connect.
        speed: Recorded seconds in one second of real time.

    Returns:
        The exit code of the signal.

    Raises:
        ServerError: If the address or the port cannot be used.
    """

    async def play(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        peer = peer_name(writer.transport)
        log.info("%s: connected", peer)
        # Commands are read and ignored, because a client would block once buffers are
        # full.
        ignoring = asyncio.ensure_future(_ignore(reader))
        loop = asyncio.get_running_loop()
        start = loop.time()
        with suppress(OSError):
            for time, data in writes:
                # Times are measured from the start of the playback, so that delays do
                # not add up.
                await asyncio.sleep(start + time / speed - loop.time())
                if writer.is_closing():
                    break
                writer.write(data)
                # Waiting for slow clients keeps the write buffer small.
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
    """Read and discard all bytes from a client."""
    with suppress(OSError):
        while await reader.read(65536):
            pass
