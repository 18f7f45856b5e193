"""TCP proxy between clients and a server that forwards every byte unchanged.

``TcpProxy`` forwards between sockets. A ``TrafficObserver`` parses a copy of the
traffic in a thread of its own, ``ConnectionState`` holds what one connection has said,
and ``RobotSelector`` passes the reports of one robot to a consumer such as a mapper.
A ``RobotWatcher`` stands where the proxy does, on servers that let robots be watched.
"""

from radarsim.autonomy.proxy.observer import (
    ConnectionState,
    Consumer,
    RobotSelector,
    ScannerDefaults,
    TrafficObserver,
)
from radarsim.autonomy.proxy.tcp_proxy import TcpProxy, forward_until_signal

__all__ = [
    "ConnectionState",
    "Consumer",
    "RobotSelector",
    "ScannerDefaults",
    "TcpProxy",
    "TrafficObserver",
    "forward_until_signal",
]
