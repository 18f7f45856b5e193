"""Goal-directed navigation with Bug1, Bug2, tangent bug and planned paths.

A navigator receives scans and poses, as any USARSim client does, and never the scene.
"""
