"""A TCP server around the host: sockets, signals and the wall clock."""
