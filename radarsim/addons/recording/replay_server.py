"""Send to any client what a recorded one was sent, at the same times."""

import asyncio
import logging
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass

from radarsim.addons.recording.host_recorder import CallKind, HostCall
from radarsim.errors import RecordingError
from radarsim.listening import exit_code_of_signal, listen, peer_name
from radarsim.simulation.clock import seconds

log = logging.getLogger("radarsim.addons.recording")


@dataclass(frozen=True, slots=True)
class RecordedClient:
    """What one client was sent.

    Attributes:
        number: Number of the client, from 1.
        writes: The bytes of each write, and the time since it connected, s.
    """

    number: int
    writes: tuple[tuple[float, bytes], ...]

    @property
    def size(self) -> int:
        """The number of bytes."""
        return sum(len(data) for _, data in self.writes)


def recorded_clients(calls: Iterable[HostCall]) -> dict[int, RecordedClient]:
    """Collect what each client was sent, by its number."""
    starts: dict[int, int] = {}
    writes: dict[int, list[tuple[float, bytes]]] = {}
    for kind, tick, client, data in calls:
        if kind is CallKind.CONNECT:
            starts[client] = tick
            writes[client] = []
        elif kind in (CallKind.TAKE, CallKind.FINISH) and data:
            writes[client].append((seconds(tick - starts[client]), data))
    return {
        number: RecordedClient(number, tuple(each)) for number, each in writes.items()
    }


def choose_client(
    clients: dict[int, RecordedClient], wanted: int | None
) -> RecordedClient:
    """Return a client by its number; without one, that which was sent most.

    Raises:
        RecordingError: If there is no such client.
    """
    if not clients:
        raise RecordingError("no client in the recording, expected at least one")
    if wanted is None:
        return max(clients.values(), key=lambda each: (each.size, -each.number))
    if wanted not in clients:
        numbers = ", ".join(map(str, sorted(clients)))
        raise RecordingError(f"client {wanted}, expected one of {numbers}")
    return clients[wanted]


class ReplayServer:
    """Plays what one client was sent to each client that connects.

    What these send is read and ignored. A client that reads too slowly gets everything
    later, as nothing is left out.
    """

    def __init__(self, recorded: RecordedClient, *, speed: float = 1.0) -> None:
        """Create a server that does not listen yet.

        Args:
            recorded: What is played.
            speed: Recorded seconds in one second of real time.
        """
        self._writes: Sequence[tuple[float, bytes]] = recorded.writes
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
        ignoring = asyncio.ensure_future(_ignore(reader))
        loop = asyncio.get_running_loop()
        start = loop.time()
        with suppress(OSError):
            for time, data in self._writes:
                await asyncio.sleep(start + time / self._speed - loop.time())
                if writer.is_closing():
                    break
                writer.write(data)
                await writer.drain()
        ignoring.cancel()
        writer.close()
        log.info("%s: disconnected", peer)


async def _ignore(reader: asyncio.StreamReader) -> None:
    """Read what a client sends."""
    with suppress(OSError):
        while await reader.read(65536):
            pass
