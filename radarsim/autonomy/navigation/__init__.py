"""Algorithms that drive a robot to goals: Bug1, Bug2, tangent bug, planned paths.

A navigator receives scans and poses, as any USARSim client does, and never the scene.
"""
