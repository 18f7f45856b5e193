"""Goal-directed navigation by what a USARSim client receives: bumpers, Bug1 and Bug2.

A navigator sees scans and poses, as any client does, and never the scene.
"""
