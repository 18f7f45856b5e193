"""Procedural trees and shrubs.

Theory of operation
===================
`species` defines the kinds of plants, each by its `PlantParameters`. `growth` grows the
wood towards the ends of the twigs. `plant` turns it into closed tubes, places leaves
around the ends, creates one shrub with foliage in three shapes, and encodes mesh files.
`examples/thesis/calibrate_plants.py` calibrates the loss of each shape, so that all
three let the same share of power through.
"""
