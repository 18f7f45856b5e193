"""The server without sockets: it exchanges bytes and advances time in ticks."""

from radarsim.server.host.connection import Diagnostic
from radarsim.server.host.host import Host, HostObserver

__all__ = ["Diagnostic", "Host", "HostObserver"]
