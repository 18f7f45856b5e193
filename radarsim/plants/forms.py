"""What plants look like: numbers of no species."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from radarsim.geometry import Floats

WOOD: Final = "Wood"  # names of materials in mesh files
LEAVES: Final = "Leaves"


@dataclass(frozen=True, slots=True)
class PlantForm:
    """A plant's measures, in m where nothing else is said.

    The crown is an ellipsoid above the origin, which is on the ground. All leaves and
    all twigs end in it.

    Attributes:
        crown_centre: Its height above the ground.
        crown_radius: In the level plane.
        crown_half_height: The same upward.
        stems: How many come out of the ground.
        stem_length: How long they are before wood reaches out for the crown.
        stem_lean_deg: How far several stems lean outward, off the vertical.
        clear_height: Nothing branches off below.
        stem_radius: At the ground.
        tip_radius: At the ends of the twigs.
        twigs: How many places in the crown wood reaches for.
        levels: How many times wood branches at most, from the stem to a twig.
        spread_deg: The angle between a branch and what it leaves, at most wherever
            there is a place to leave from.
        directness: 0 spends the least wood, 1 goes from the ground to each twig on
            the shortest way.
        leaves: How many.
        leaf_length: From base to tip.
        leaf_width: Where it is widest.
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
        """The middle of the crown, (3,) m."""
        return np.array([0.0, 0.0, self.crown_centre])

    @property
    def half_axes(self) -> Floats:
        """Of the crown, (3,) m."""
        r = self.crown_radius
        return np.array([r, r, self.crown_half_height])


SHRUB: Final = PlantForm(
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

TREE: Final = PlantForm(
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

YOUNG_TREE: Final = PlantForm(
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
