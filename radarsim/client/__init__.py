"""A client of any server that speaks USARSim's protocol, with two faces.

``Client`` waits in the calling thread, ``AsyncClient`` in an event loop; what they say
and understand is the same code, which knows no sockets. Reports are those of
``radarsim.protocol.reports``: metres, radians and REP-103, whatever is on the wire.
"""

from radarsim.client.aio import AsyncClient
from radarsim.client.robot_info import DriveUnit, RobotInfo, ScannerInfo, beam_angles
from radarsim.client.session import Question, Session
from radarsim.client.sync import Client
from radarsim.client.transport import SocketTransport, Transport
from radarsim.errors import ClientError, ClientTimeout

__all__ = [
    "AsyncClient",
    "Client",
    "ClientError",
    "ClientTimeout",
    "DriveUnit",
    "Question",
    "RobotInfo",
    "ScannerInfo",
    "Session",
    "SocketTransport",
    "Transport",
    "beam_angles",
]
