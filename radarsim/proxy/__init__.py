"""A tap between clients and a server: every byte passes, and a copy is listened to.

``TcpProxy`` forwards between sockets and does nothing else. A ``Listener`` takes its
copy in a thread of its own; ``ConnectionState`` is what a connection has told so far,
and ``Choice`` gives the reports of one robot to whoever makes something of them,
such as a map.
"""

from radarsim.proxy.connection_state import ConnectionState, ScannerDefaults
from radarsim.proxy.observer import Choice, Consumer, Listener
from radarsim.proxy.tcp_proxy import TcpProxy, forward_until_signal

__all__ = [
    "Choice",
    "ConnectionState",
    "Consumer",
    "Listener",
    "ScannerDefaults",
    "TcpProxy",
    "forward_until_signal",
]
