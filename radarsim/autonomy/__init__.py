"""Clients that decide by themselves, and what judges them.

Nothing here is needed to serve a map. Navigators, mappers and explorers see what any
client of a USARSim server receives, and never the scene; only ``evaluation`` knows the
truth.
"""
