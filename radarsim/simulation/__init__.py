"""Simulation of robots with sensors in a scene, in steps of simulated time."""
