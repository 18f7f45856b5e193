"""Autonomous clients: navigation, mapping and exploration, and their evaluation.

The server does not need this package. Navigators, mappers and explorers receive the
reports that any USARSim client receives, and never the scene. Only ``evaluation`` has
access to the ground truth.
"""
