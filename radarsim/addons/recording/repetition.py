"""Repeat a recorded run, and compare what clients were sent byte by byte."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from radarsim.addons.recording.host_recorder import CallKind, HostCall
from radarsim.server.host.host import Host

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


def repeat_run(host: Host, calls: Iterable[HostCall]) -> Repetition:
    """Repeat a run up to the first difference.

    Args:
        host: A host of the recorded conditions whose simulation has not begun.
        calls: The recorded calls, in order.
    """
    tick = clients = equal = 0
    lines: Counter[int] = Counter()
    for call in calls:
        while tick < call.tick:
            host.step()
            tick += 1
        if call.kind is CallKind.CONNECT:
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


def _repeat(host: Host, call: HostCall) -> bytes | None:
    """Repeat one call; return what the client is sent, None if it is sent nothing."""
    match call.kind:
        case CallKind.TAKE:
            return host.take(call.client)
        case CallKind.FINISH:
            return host.finish(call.client)
        case CallKind.RECEIVE:
            host.receive(call.client, call.data)
        case CallKind.CONNECT:
            host.connect()
        case CallKind.DISCONNECT:
            host.disconnect(call.client)
        case _:
            _begin(host, call)
    return None


def _begin(host: Host, call: HostCall) -> None:
    """Repeat what is done before simulated time begins."""
    if call.kind is CallKind.BEGIN:
        host.begin(host.make_simulation())
    elif call.kind is CallKind.WAIT:
        for _ in range(call.client):
            host.step()


def _difference(call: HostCall, sent: bytes, lines_before: int) -> Difference:
    """Find the first byte that differs."""
    shorter = min(len(sent), len(call.data))
    equal = next((i for i in range(shorter) if sent[i] != call.data[i]), shorter)
    start = call.data.rfind(b"\n", 0, equal) + 1
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
