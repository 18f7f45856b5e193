"""Colours of all pictures of the program; each colour has one meaning.

This is the only table of colours. Plots import it, and the web page receives
``PAGE_COLOURS`` as a style sheet.

Materials have the colour of their family: foliage is green, wood brown, concrete and
brick grey, smoke and dust a translucent pale sand. In every picture radars are violet
and lasers orange; several radars or lasers differ in lightness. The path of a robot is
blue, and true outlines and paths are red. Only in pictures that distinguish the left
and right rays of a radar, left is red and right blue, as in the thesis.

The colours of a picture can be distinguished with normal vision, deuteranopia and
protanopia; the tests list the groups of colours that are used together.
"""

import re
from collections.abc import Iterable, Mapping
from enum import StrEnum
from typing import Final

from matplotlib.colors import to_hex, to_rgb

from radarsim.scene.material import Material


class Family(StrEnum):
    """Families of materials that share a colour; the values appear in legends."""

    FOLIAGE = "foliage"
    WOOD = "wood"
    STONE = "concrete, brick"
    METAL = "metal"
    GLASS = "glass"
    SMOKE = "smoke, dust, rain"
    GROUND = "ground"


PAPER: Final = "#ffffff"
PALE: Final = 0.45  # share of a colour in its mixture with white
INK: Final = "#191818"  # text, outlines, markers, robots

# Colours as they appear on white paper; ``area_style`` computes translucent fills.
FAMILY_COLOURS: Final = {
    Family.FOLIAGE: "#a5c262",
    Family.WOOD: "#6b2610",
    Family.STONE: "#aaabad",
    Family.METAL: "#33486a",
    Family.GLASS: "#bdd4fc",
    Family.SMOKE: "#ebd3b0",
    Family.GROUND: "#a38162",
}

# Colours of the left and the right ray of a radar, as in the thesis.
LEFT_RAY: Final = "#d12c19"
RIGHT_RAY: Final = "#1563be"

RADAR: Final = "#6a4aeb"
LASER: Final = "#ff5704"
# Colours of several radars or lasers that one picture compares.
RADARS: Final = (RADAR, "#2b1780", "#b3a2f7")
LASERS: Final = (LASER, "#8f2d00", "#ffa875")

# Colour of the power that an object sends back to the radar.
RETURNED: Final = "#047e7d"

# Colours of navigation and mapping runs; sensed cells have the colour of the sensor.
TRUTH: Final = "#cc1400"  # true outlines and true paths
GOING: Final = "#06a8fe"  # path of a robot, or its path towards the goal
FOLLOWING: Final = "#ffc800"  # path along a boundary, and the hit point it begins at
RETURNING: Final = "#0b6b57"  # path back to the leave point
TARGET: Final = "#e11dbb"  # goals
UNKNOWN_SENSOR: Final = LASER
# Colours of several robots in one picture, for footprints and readings of sensors.
ROBOTS: Final = (
    *("#44aabb", "#cc4455", "#eecc00", "#8833aa", "#22bb99"),
    *("#5a8cf0", "#665577", "#00ee99", "#77bbff", "#99dd66"),
)
NOT_SENSED: Final = "#c2cbe0"  # cells of a map that no beam has crossed
MARKER: Final = INK  # markers and their edges
ROBOT: Final = PAPER  # footprint of the robot, outlined in ``MARKER``

# Colours of charts.
GRID: Final = "#dddddd"  # grid lines

# Colours of the web page, in its light and its dark theme.
PAGE_COLOURS: Final[Mapping[str, tuple[str, str]]] = {
    "paper": (PAPER, "#1b1e23"),
    "ink": (INK, "#eceef1"),
    "radar": (RADAR, "#7c5cff"),
    "laser": (LASER, "#ff6414"),
    "true": (TRUTH, "#d40000"),
    "path": (GOING, GOING),
    "hit": (FOLLOWING, FOLLOWING),
    "leave": (GOING, GOING),
    "goal": (TARGET, "#c031bc"),
    "robot": (ROBOT, "#3b414b"),
}

# The last known word of a name gives the family: a "wood_floor" is ground.
_WORDS: Final = {
    Family.FOLIAGE: "foliage|hedge|shrub|bush|leaf|leaves|twigs|woodland|grass|crop",
    Family.WOOD: "wood|wooden|plank|bark|trunk|crate|chipboard|board",
    Family.STONE: "concrete|brick|stone|wall|plaster|plasterboard|rock",
    Family.METAL: "metal|steel|iron|aluminium|aluminum|car|mirror|robot",
    Family.GLASS: "glass|pane|window|water",
    Family.SMOKE: "smoke|dust|fog|rain|mist|haze|cloud|snow|spray|steam",
    Family.GROUND: "ground|soil|floor|earth|sand|gravel|asphalt|road",
}
_FAMILY_OF_WORD: Final = {
    word: family for family, words in _WORDS.items() for word in words.split("|")
}


def family_of(material: Material) -> Family:
    """Return a material's family, found from the words of its name or its properties.

    Without a known word, solid materials that beams can enter are foliage, materials
    that robots can also enter are smoke, mirrors are metal, and all others concrete.
    """
    words = re.split(r"[^a-z]+", material.name.casefold())
    named = [_FAMILY_OF_WORD[word] for word in words if word in _FAMILY_OF_WORD]
    if Family.FOLIAGE in named and material.lets_beams_in:
        return Family.FOLIAGE  # a "shrub_cloud" is foliage, not smoke
    if named:
        return named[-1]
    if material.lets_beams_in:
        return Family.FOLIAGE if material.solid else Family.SMOKE
    mirror = material.radar_mirror or material.laser_mirror
    return Family.METAL if mirror else Family.STONE


def names_by_family(materials: Iterable[Material]) -> dict[Family, list[str]]:
    """Group the names of materials by their families, in order, each name once."""
    names: dict[Family, dict[str, None]] = {}
    for material in materials:
        names.setdefault(family_of(material), {})[material.name] = None
    return {family: [*of_family] for family, of_family in names.items()}


def colour_of(material: Material) -> str:
    """Return the colour of a material, which is the colour of its family."""
    return FAMILY_COLOURS[family_of(material)]


def sensor_colour(medium: str) -> str:
    """Return the colour of a sensor type, ``radar`` or ``laser``."""
    return RADAR if medium == "radar" else LASER


def paler(colour: str) -> str:
    """Return a colour mixed with white, to fill areas behind markers and lines."""
    red, green, blue = (1 - PALE * (1 - part) for part in to_rgb(colour))
    return to_hex((red, green, blue))
