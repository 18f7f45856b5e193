"""Where a line crosses triangles, in float64, and the list of a ray's crossings.

Theory of operation
===================
The triangle is seen along the line: points are sheared so that the line becomes the
third axis. The line crosses the triangle if the origin is inside the triangle's
projection onto the first two axes, which is so where it is on the same side of all
three edges. The depth of the crossing is interpolated from the depths of the corners.

Rule 1: each corner is sheared on its own by the same operations, so that it has one
projection, whichever triangle it is taken from.
Rule 2: the side of an edge is the sign of a difference of two products. Rounding can
make this difference zero, but never reverses its sign; computed for the triangle on the
other side of the edge, it is the exact opposite.
Rule 3: where it is zero, the line goes through the edge. It is treated as passing
beside the edge, displaced by an infinitesimal step along the first axis and a still
smaller one along the second, the same for all triangles (simulation of simplicity).
Hence a line through an edge or a corner crosses exactly one triangle of a surface, and
along any line a closed surface is entered as often as it is left.
Rule 4: the depth is a mean of the corners' depths with weights of one sign, so that no
grazing line is given a crossing outside the triangle.
"""

from typing import Final

TINY: Final = 1e-30  # m; smaller coordinates are set to zero, see ``intersect.hpp``
