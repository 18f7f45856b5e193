"""The engine: a C++ library that is compiled when radarsim is installed."""

from radarsim.engine.library import Packed, address, engine

__all__ = ["Packed", "address", "engine"]
