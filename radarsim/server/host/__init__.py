"""The server without sockets: bytes in, bytes out, time in ticks."""

from radarsim.server.host.connection import Diagnostic
from radarsim.server.host.host import Host, HostObserver

__all__ = ["Diagnostic", "Host", "HostObserver"]
