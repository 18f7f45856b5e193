"""Robots: their state, kinematics and collisions."""
