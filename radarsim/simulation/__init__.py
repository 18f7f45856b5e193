"""Robots with their sensors in a scene, in steps of simulated time."""
