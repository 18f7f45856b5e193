"""Procedural trees and shrubs, and the effect of their shapes on radar beams.

Theory of operation
===================
`parameters` defines the shapes of plants. `growth` grows the wood towards the ends of
the twigs, `mesh` turns it into closed tubes and places leaves around the ends. `plant`
joins them, creates one shrub with foliage in three shapes, and writes mesh files.
`calibration` finds the loss of each shape at which all three let the same share of
power through; `range_profile` and `figure` show the differences that remain.

``python -m radarsim.scene.plants maps/meshes`` writes the meshes of the shipped maps.
"""
