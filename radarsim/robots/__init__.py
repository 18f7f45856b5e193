"""Robots on the floor: how they drive, what stops them, what they carry along."""
