"""A robot finds its way by what comes over the wire: bumpers of beams, Bug1 and Bug2.

A navigator sees scans and poses as any USARSim client does, and never the scene.
"""
