"""Colours of materials, which are the same in all pictures of the program."""

from radarsim.plotting.palette import FAMILY_COLOURS, family_of
from radarsim.scene.material import Material


def colour_of(material: Material) -> str:
    """Return the colour of a material as ``#rrggbb``."""
    return FAMILY_COLOURS[family_of(material)]
