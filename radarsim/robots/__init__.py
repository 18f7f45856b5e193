"""Robots on the floor: kinematics, collisions, and their state."""
