"""The species of plants: their shapes, their wood and their leaves."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from radarsim.geometry import Floats


@dataclass(frozen=True, slots=True)
class PlantParameters:
    """Parameters of a plant, in m unless stated otherwise.

    The crown is an ellipsoid above the origin, which is on the ground. All leaves and
    all twigs end in it.

    Attributes:
        crown_centre: Height of the crown's centre above the ground.
        crown_radius: Horizontal half-axis of the crown.
        crown_half_height: Vertical half-axis of the crown.
        stems: Number of stems that come out of the ground.
        stem_length: Length of the stems before branches grow to the twigs' ends.
        stem_lean_deg: Angle between stems and the vertical, at most.
        clear_height: Height below which nothing branches off.
        stem_radius: Radius of the stems at the ground.
        tip_radius: Radius at the ends of the twigs.
        twigs: Number of twigs' ends in the crown.
        levels: Largest number of branchings from a stem to a twig.
        spread_deg: Largest angle between a branch and its parent, as long as there is
            a point to branch off from.
        directness: 0 uses the least wood, 1 the shortest paths from the ground to each
            twig.
        leaves: Number of leaves.
        leaf_length: Length of a leaf from base to tip.
        leaf_width: Largest width of a leaf.
        cluster: Standard deviation of the leaves' distances from their twig's end,
            along each axis.
    """

    crown_centre: float
    crown_radius: float
    crown_half_height: float
    stems: int
    stem_length: float
    stem_lean_deg: float
    clear_height: float
    stem_radius: float
    tip_radius: float
    twigs: int
    levels: int
    spread_deg: float
    directness: float
    leaves: int
    leaf_length: float
    leaf_width: float
    cluster: float

    @property
    def centre(self) -> Floats:
        """Centre of the crown, (3,) m."""
        return np.array([0.0, 0.0, self.crown_centre])

    @property
    def half_axes(self) -> Floats:
        """Half-axes of the crown, (3,) m."""
        r = self.crown_radius
        return np.array([r, r, self.crown_half_height])


SHRUB: Final = PlantParameters(
    crown_centre=0.9,
    crown_radius=1.0,
    crown_half_height=1.0,
    stems=6,
    stem_length=0.35,
    stem_lean_deg=25,
    clear_height=0.1,
    stem_radius=0.022,
    tip_radius=0.003,
    twigs=90,
    levels=4,
    spread_deg=65,
    directness=0.35,
    leaves=6000,
    leaf_length=0.14,
    leaf_width=0.09,
    cluster=0.13,
)

TREE: Final = PlantParameters(
    crown_centre=4.2,
    crown_radius=1.9,
    crown_half_height=2.4,
    stems=1,
    stem_length=5.2,
    stem_lean_deg=2,
    clear_height=1.7,
    stem_radius=0.14,
    tip_radius=0.007,
    twigs=140,
    levels=4,
    spread_deg=75,
    directness=0.4,
    leaves=3600,
    leaf_length=0.24,
    leaf_width=0.15,
    cluster=0.22,
)

YOUNG_TREE: Final = PlantParameters(
    crown_centre=1.9,
    crown_radius=0.8,
    crown_half_height=1.4,
    stems=1,
    stem_length=2.6,
    stem_lean_deg=3,
    clear_height=0.5,
    stem_radius=0.04,
    tip_radius=0.004,
    twigs=60,
    levels=3,
    spread_deg=70,
    directness=0.3,
    leaves=1300,
    leaf_length=0.16,
    leaf_width=0.09,
    cluster=0.13,
)
