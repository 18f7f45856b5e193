"""TCP servers for a simulation, which handle sockets, signals and the wall clock."""
