"""A server that sends the data of a robot's FMCW radar in Navtech's protocol.

Theory of operation
===================
Clients receive the configuration of the radar when they connect, or as soon as there is
a radar, and on request. The data of each azimuth is sent to all clients that have
requested data, in the tick in which the radar receives it.

Rule 1: a slow client misses azimuths, and can detect the gaps by the sweep counter. A
client that reads nothing for ``PATIENCE`` is disconnected. The server never waits for
clients.
Rule 2: messages of a client are read at most once per ``READ_PAUSE``, so that a flood
of messages does not slow down the ticks. An invalid message ends the connection.
Rule 3: the antenna rotates only while a client has requested data, or the radar has a
detector.
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

PORT: Final = 6317  # the port of real radars
MAX_CLIENTS: Final = 8
MOST_UNSENT: Final = 262_144  # bytes; about 60 azimuths
PATIENCE: Final = 10.0  # s


class NavtechServer(PeerServer, HostObserver):
    """Serves the data of a robot's radar to clients; observes the simulation's host."""

    def __init__(self, *, port: int = PORT, robot: str | None = None) -> None:
        """Create a radar server that does not listen yet.

        Args:
            port: Port to listen on; 0 for a free port.
            robot: Name of the robot, in upper or lower case; None for the first robot
                that carries such a radar.
        """
        super().__init__(port, "radar clients")
        self._robot = robot
        self._simulation: Simulation
        self._antenna: Antenna | None = None
        self._configuration = b""

    def _accept(self) -> RadarClient:
        return RadarClient(self)

    def begin(self, simulation: Simulation) -> None:
        """Start to serve a radar of a simulation."""
        self._simulation = simulation

    async def stop(self) -> None:
        """Close the port and all connections immediately; raises no errors."""
        self._listen_to(None)
        await super().stop()

    def step(self, *, passes: bool) -> None:  # noqa: ARG002 - in a pause as well
        """Find the robot's radar in each tick; subscribe if a client wants data."""
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
        """Subscribe to the data of an antenna; None ends the current subscription."""
        if self._antenna is None:
            return
        listeners = self._antenna.listeners
        if antenna is None and self._hear in listeners:
            listeners.remove(self._hear)
        elif antenna is not None and self._hear not in listeners:
            listeners.append(self._hear)

    def tell(self, client: RadarClient) -> None:
        """Send the radar's configuration to a client, if there is a radar."""
        client.send(self._configuration)

    def _hear(self, sector: Sector, time: float) -> None:
        """Send azimuths, the first recorded at ``time``, s, to subscribed clients."""
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
        # The set is copied, since closing a client removes the client from the set.
        for client in list(self.peers):
            if client.wants_data:
                client.send(data)


class RadarClient(PeerConnection):
    """The connection of a client of the radar.

    Attributes:
        wants_data: Whether the client has requested data.
    """

    KIND = "radar client"
    MOST = MAX_CLIENTS

    def __init__(self, server: NavtechServer) -> None:
        """Create a connection and add it to the radar server."""
        super().__init__(server)
        self.wants_data = False
        self._server = server
        self._messages = MessageBuffer()
        self._read_at = 0.0  # time at which the send buffer was last empty

    def _begin(self, transport: asyncio.Transport) -> None:  # noqa: ARG002 - not needed
        self._server.tell(self)

    def buffer_updated(self, nbytes: int) -> None:
        """Handle the messages in received bytes, and then pause reading."""
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
        """Send complete messages, or drop them if too many bytes are unsent."""
        if self._transport is None or not data:
            return
        now = asyncio.get_running_loop().time()
        unsent = self._transport.get_write_buffer_size()
        if not unsent:
            self._read_at = now
        if unsent <= MOST_UNSENT:
            self._transport.write(data)
        # Rule 1: whole azimuths are dropped, never a part of a message.
        elif now - self._read_at > PATIENCE:
            log.warning("%s: closed: the client does not read", self.peer)
            self.close()

    def _forget(self) -> None:
        super()._forget()
        self.wants_data = False
