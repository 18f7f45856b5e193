"""Goal-directed navigation by what a USARSim client receives: Bug1, Bug2, planned paths.

A navigator sees scans and poses, as any client does, and never the scene.
"""
