"""The world in motion: robots with their sensors, in steps of simulated time."""
