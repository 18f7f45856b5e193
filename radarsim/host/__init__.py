"""The whole server without sockets: bytes in, bytes out, time by the tick."""

from radarsim.host.connection import Notice
from radarsim.host.host import Host

__all__ = ["Host", "Notice"]
