"""The whole server without sockets: bytes in, bytes out, time by the tick."""

from radarsim.host.host import Host
from radarsim.host.notices import Notice

__all__ = ["Host", "Notice"]
