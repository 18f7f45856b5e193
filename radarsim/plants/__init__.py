"""Trees and shrubs of numbers alone, and what radar beams make of their shapes.

Theory of operation
===================
``forms`` says what a plant looks like, ``growth`` lets its wood reach for places all
over the crown, ``tubes`` gives the wood a bark, ``leaves`` hangs leaves around the ends
of the twigs. ``shrub`` fills one crown in three ways; ``calibration`` finds what each
of them has to take from a beam so that they let the same share of power through.
``readings`` and ``figure`` show what is different all the same.

``python -m radarsim.plants maps/meshes`` makes the mesh files of the shipped maps.
"""
