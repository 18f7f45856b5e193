"""Goal-directed navigation by what a USARSim client receives: Bug1, Bug2, and plans.

A navigator sees scans and poses, as any client does, and never the scene.
"""
