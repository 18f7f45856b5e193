"""A client of any server that speaks USARSim's protocol, with two faces.

``Client`` waits in the calling thread, ``AsyncClient`` in an event loop; what they say
and understand is the same code, which knows no sockets. Reports are those of
``radarsim.protocol.reports``: metres, radians and REP-103, whatever is on the wire.
"""

from typing import Any

from radarsim.client.aio import AsyncClient
from radarsim.client.deprecation import warn_renamed
from radarsim.client.robot_info import RobotInfo, ScannerInfo, beam_angles
from radarsim.client.session import Question, Session
from radarsim.client.sync import Client
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

_RENAMED = {
    "Link": "Transport",
    "RobotFacts": "RobotInfo",
    "ScannerFacts": "ScannerInfo",
    "SocketLink": "SocketTransport",
}


def __getattr__(name: str) -> Any:
    if name not in _RENAMED:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    new = _RENAMED[name]
    warn_renamed(f"radarsim.client.{name}", f"radarsim.client.{new}")
    return globals()[new]
