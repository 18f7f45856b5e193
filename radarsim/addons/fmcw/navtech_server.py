"""A server of one robot's FMCW radar, in the protocol of the radar's maker.

Theory of operation
===================
Clients are told the configuration of the radar when they connect, or as soon as there
is one, and again whenever they ask. Each direction that the radar receives is sent to
all clients that have asked for data, in the tick in which it is received.

Rule 1: a client that reads too slowly misses directions, which the sweep counter tells
it; one that reads none for ``PATIENCE`` is dropped. Nobody waits for it.
Rule 2: a client is read at most once in ``READ_PAUSE``, so that no flood takes much
time from the ticks. What is no message of the protocol ends its connection.
Rule 3: only while somebody has asked for data, or the radar has a detector, does its
antenna turn.
"""

from __future__ import annotations

import asyncio
import logging
from typing import TYPE_CHECKING, Final

from radarsim.addons.fmcw.image_files import ENCODER_COUNTS
from radarsim.addons.fmcw.navtech_messages import (
    MessageBuffer,
    MessageType,
    configuration_message,
    direction_message,
)
from radarsim.addons.fmcw.rotation_schedule import antennas_of
from radarsim.server.host import HostObserver
from radarsim.server.peer_connections import PeerConnection, PeerServer

if TYPE_CHECKING:
    from radarsim.addons.fmcw.rotation import Sector
    from radarsim.addons.fmcw.rotation_schedule import Antenna
    from radarsim.presets.fmcw_settings import FmcwSettings
    from radarsim.simulation.simulation import Simulation

log = logging.getLogger("radarsim.server")

PORT: Final = 6317  # of the real radars
MAX_CLIENTS: Final = 8
MOST_UNSENT: Final = 262_144  # bytes; some 60 directions
PATIENCE: Final = 10.0  # s


class NavtechServer(PeerServer, HostObserver):
    """Serves what the radar of one robot receives; an observer of its host."""

    def __init__(self, *, port: int = PORT, robot: str | None = None) -> None:
        """Create a server that does not listen yet.

        Args:
            port: Port to listen on; 0 for a free one.
            robot: Name of the robot, in any case; None for the first one that carries
                such a radar.
        """
        super().__init__(port, "radar clients")
        self._robot = robot
        self._simulation: Simulation
        self._antenna: Antenna | None = None
        self._configuration = b""

    def _accept(self) -> RadarClient:
        return RadarClient(self)

    def begin(self, simulation: Simulation) -> None:
        """Serve a radar of a simulation from now on."""
        self._simulation = simulation

    async def stop(self) -> None:
        """Close the port and all connections at once; never raises."""
        self._listen_to(None)
        await super().stop()

    def step(self, *, passes: bool) -> None:  # noqa: ARG002 - in a pause as well
        """Follow the robot, which can come or leave, and listen while clients do."""
        wanted = None if self._robot is None else self._robot.casefold()
        carried = (
            each
            for each in antennas_of(self._simulation).all
            if wanted in (None, each.vehicle.robot.name.casefold())
        )
        antenna = next(carried, None)
        if antenna is not self._antenna:
            self._listen_to(None)
            self._antenna = antenna
            self._configuration = b""
            if antenna is not None:
                settings: FmcwSettings = antenna.mounted.scanner.fmcw.settings
                self._configuration = configuration_message(
                    settings.azimuths,
                    settings.bin_size,
                    settings.bins,
                    ENCODER_COUNTS,
                    settings.rotation_hz,
                    round(settings.rotation_hz * settings.azimuths),
                )
            for client in self.peers:
                self.tell(client)
        is_wanted = any(client.wants_data for client in self.peers)
        self._listen_to(antenna if is_wanted else None)

    def _listen_to(self, antenna: Antenna | None) -> None:
        """Listen to an antenna, and to no other."""
        if self._antenna is None:
            return
        listeners = self._antenna.listeners
        if antenna is None and self._hear in listeners:
            listeners.remove(self._hear)
        elif antenna is not None and self._hear not in listeners:
            listeners.append(self._hear)

    def tell(self, client: RadarClient) -> None:
        """Send the configuration, if there is a radar."""
        client.send(self._configuration)

    def _hear(self, sector: Sector, time: float) -> None:
        """Send directions, received from a time on, s, to all who want them."""
        settings = sector.spectrum.settings
        data = b"".join(
            direction_message(
                (sector.turn * settings.azimuths + row) % 2**16,
                row * ENCODER_COUNTS // settings.azimuths,
                round((time + k * settings.sweep_time) * 1e9),
                sector.spectrum.counts[k].tobytes(),
            )
            for k, row in enumerate(sector.rows)
        )
        # A copy, as a client that is closed leaves the set.
        for client in list(self.peers):
            if client.wants_data:
                client.send(data)


class RadarClient(PeerConnection):
    """One connection of a client.

    Attributes:
        wants_data: Whether it has asked for data.
    """

    KIND = "radar client"
    MOST = MAX_CLIENTS

    def __init__(self, server: NavtechServer) -> None:
        """Create the protocol of a connection, which adds itself to the server."""
        super().__init__(server)
        self.wants_data = False
        self._server = server
        self._messages = MessageBuffer()
        self._read_at = 0.0  # when all that was sent had left last

    def _begin(self, transport: asyncio.Transport) -> None:  # noqa: ARG002 - not needed
        self._server.tell(self)

    def buffer_updated(self, nbytes: int) -> None:
        """Act on received messages, and read no more for a while."""
        messages = self._messages.feed(bytes(self._buffer[:nbytes]))
        types = [kind for kind, _ in messages]
        if MessageType.CONFIGURATION_REQUEST in types:
            self._server.tell(self)
        for kind in types:
            if kind in (MessageType.START, MessageType.STOP):
                self.wants_data = kind == MessageType.START
        if self._messages.problem:
            log.warning("%s: closed: %s", self.peer, self._messages.problem)
            self.close()
        else:
            self._rest()  # rule 2

    def send(self, data: bytes) -> None:
        """Send whole messages, or none of them if too many still wait."""
        if self._transport is None or not data:
            return
        now = asyncio.get_running_loop().time()
        unsent = self._transport.get_write_buffer_size()
        if not unsent:
            self._read_at = now
        if unsent <= MOST_UNSENT:
            self._transport.write(data)
        # Rule 1: whole directions are left out, never a part of one.
        elif now - self._read_at > PATIENCE:
            log.warning("%s: closed: the client does not read", self.peer)
            self.close()

    def _forget(self) -> None:
        super()._forget()
        self.wants_data = False
