"""Procedural trees and shrubs.

Theory of operation
===================
`parameters` defines the shapes of plants: a species is a `PlantParameters` there.
`growth` grows the wood towards the ends of the twigs, `mesh` turns it into closed tubes
and places leaves around the ends. `plant` joins them, creates one shrub with foliage in
three shapes, and encodes mesh files. `radarsim.lab.plants` calibrates the loss of each
shape, so that all three let the same share of power through.
"""
