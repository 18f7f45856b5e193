"""The whole server without sockets: bytes in, bytes out, time by the tick."""

from radarsim.host.connection import Diagnostic
from radarsim.host.host import Host

__all__ = ["Diagnostic", "Host"]
