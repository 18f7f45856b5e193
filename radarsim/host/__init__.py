"""The server without sockets: bytes in, bytes out, time in ticks."""

from radarsim.host.connection import Diagnostic
from radarsim.host.host import Host

__all__ = ["Diagnostic", "Host"]
