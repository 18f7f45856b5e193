"""The penetration model: the power that a ray loses, and where it ends.

Theory of operation
===================
A ray starts with a penetration power. Inside volumes it loses, per metre, the sum of
the densities of all volumes that enclose the point, and of the air. It ends at the
first opaque surface, where its power runs out, or at its maximum range. An opaque
surface absorbs power of its own; a ray that arrives with less returns nothing.

A reflected ray consists of several straight segments. Each is followed separately and
starts with the power left by the one before. This module knows neither the scene nor
Embree: it follows one segment through its sorted list of crossings, in float64.

A part encloses the ray where its winding number is positive: the winding number at the
start, plus one for each triangle that the ray enters by its front, minus one for each
that it leaves by its back. Hence overlapping shells of a part count once, cavities are
outside, and two crossings on a grazed edge cancel in either order.

Rule 1: the list of crossings is complete and without duplicates; ``intersect`` ensures
that.
Rule 2: the density is summed anew after each crossing. Adding and subtracting would
leave a rounding error: a ray that has left all volumes loses exactly nothing.
Rule 3: a remaining power that is due to rounding alone counts as zero.

Source: the recursion in a thesis on a radar for USARSim, written as a loop. There a
penetrable object costs density times length, and the range that is measured is that of
the point where the power runs out.
"""

from enum import IntEnum
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import engine

# One row for each event; the fields are those of ``rays.Event``.
EVENT: Final = engine.rows["Event"]
Events: TypeAlias = NDArray[np.void]  # of EVENT


class Outcome(IntEnum):
    """How a ray ends."""

    NOTHING = 0
    HIT = 1
    SPENT = 2
    ABSORBED = 3


class EventKind(IntEnum):
    """What happens to a ray at one point of its path."""

    START_INSIDE = 0
    ENTER = 1
    LEAVE = 2
    SHEET = 3
    HIT = 4
    SPENT = 5
    OUT_OF_RANGE = 6
    MIRRORED = 7
    ABSORBED = 8
    RAIN = 9  # added by sensors: rain has no surfaces
