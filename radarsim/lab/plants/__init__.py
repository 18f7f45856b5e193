"""Calibration of the shipped shrubs, the figure of their three shapes, mesh files.

``python -m radarsim.lab.plants maps/meshes`` writes the meshes of the shipped maps.
"""
