"""A client for any server of the USARSim protocol, blocking or asynchronous.

``Client`` blocks the calling thread, ``AsyncClient`` is for an event loop. Both share
the code that writes requests and reads answers, which does no I/O. Reports are
instances of the classes in ``radarsim.protocol.reports``, in metres, radians and
REP-103 frames for every server.
"""

from radarsim.client.clients import AsyncClient, Client
from radarsim.client.robot_info import RobotInfo, ScannerInfo, beam_angles
from radarsim.client.session import Question, Session
from radarsim.client.transport import SocketTransport, Transport
from radarsim.errors import ClientError, ClientTimeout
from radarsim.protocol.dialect import DriveUnit

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
