"""The shell around the host: sockets, signals, and the wall clock."""

from radarsim.server.tcp_server import Server, serve

__all__ = ["Server", "serve"]
