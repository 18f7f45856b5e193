"""Colours of all pictures of the program; each colour has one meaning.

Materials have the colour of their family: foliage is green, wood brown, concrete and
brick grey, smoke and dust a pale sand that is drawn translucent. All radars are violet
and all lasers orange, in every picture; several lasers differ in lightness, from brown
to yellow. Only where left and right rays of a radar are told apart they are coloured as
in the thesis: left red, right blue.

All colours that one picture shows together differ for normal sight, deuteranopia and
protanopia; ``SHOWN_TOGETHER`` lists these groups.
"""

import re
from enum import StrEnum
from typing import Final

from matplotlib.colors import to_hex, to_rgb

from radarsim.scene.material import Material


class Family(StrEnum):
    """Families of materials that share a colour; the values are words for legends."""

    FOLIAGE = "foliage"
    WOOD = "wood"
    STONE = "concrete, brick"
    METAL = "metal"
    GLASS = "glass"
    SMOKE = "smoke, dust, rain"
    GROUND = "ground"


PAPER: Final = "#ffffff"
PALE: Final = 0.45  # share of a colour in its paler one
INK: Final = "#191818"  # text, outlines, markers, robots

# As they look on paper; what is translucent is painted darker, see ``area_style``.
FAMILY_COLOURS: Final = {
    Family.FOLIAGE: "#a5c262",
    Family.WOOD: "#6b2610",
    Family.STONE: "#aaabad",
    Family.METAL: "#33486a",
    Family.GLASS: "#bdd4fc",
    Family.SMOKE: "#ebd3b0",
    Family.GROUND: "#a38162",
}

# As in the thesis, the left ray is red and the right ray blue.
LEFT_RAY: Final = "#d12c19"
RIGHT_RAY: Final = "#1563be"

RADAR: Final = "#6a4aeb"
LASER: Final = "#ff5704"
LASERS: Final = ("#7a2500", "#e04a00", "#ffb000")  # that are compared in one picture

# Power that comes back of a radar beam.
RETURNED: Final = "#047e7d"

# Parts of navigation and mapping runs; what is sensed has the colour of the sensor.
GOING: Final = "#06a8fe"  # path towards the goal
FOLLOWING: Final = "#ffc800"  # path along a boundary
RETURNING: Final = "#0b6b57"  # path back to the leave point
TARGET: Final = "#e11dbb"  # goals
TRUE_PATH: Final = INK
UNKNOWN_SENSOR: Final = LASER
MAPPED_PATH: Final = LEFT_RAY  # path of a robot over the map that it makes
ROBOT_PATHS: Final = (MAPPED_PATH, RADAR, FOLLOWING)  # of robots that map together
NOT_SENSED: Final = "#9aa3ad"  # cells of a map that no beam has crossed
TRUE_OUTLINE: Final = RIGHT_RAY  # over a map: what is truly there
MARKER: Final = INK  # markers, and their edges
ROBOT: Final = PAPER  # hull of the robot, outlined in ``MARKER``

_ON_MATERIALS = (PAPER, INK, *FAMILY_COLOURS.values())
_OUTLINES = (Family.STONE, Family.FOLIAGE, Family.SMOKE)  # of runs
_RUN = (
    PAPER,
    TRUE_PATH,
    GOING,
    FOLLOWING,
    RETURNING,
    TARGET,
    *(FAMILY_COLOURS[family] for family in _OUTLINES),
)
_CELLS = (
    NOT_SENSED,
    PAPER,
    INK,
    *(FAMILY_COLOURS[family] for family in (Family.FOLIAGE, Family.SMOKE)),
)
SHOWN_TOGETHER: Final = {
    "left and right rays": (*_ON_MATERIALS, LEFT_RAY, RIGHT_RAY),
    "beam and what comes back": (*_ON_MATERIALS, RADAR, RETURNED),
    "sensors over a plan": (*_ON_MATERIALS, RADAR, LASER),
    "a radar and several lasers": (PAPER, INK, RADAR, *LASERS),
    **{f"run with {sensor}": (*_RUN, sensor) for sensor in (RADAR, LASER)},
    "map": (*_CELLS, *ROBOT_PATHS, TRUE_OUTLINE),
}

# The last word of a name that is found decides: a "wood_floor" is ground.
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
    """Return the family of a material: by the words of its name, or what it lets pass.

    Solid materials that radar enters count as foliage, those that robots enter as
    smoke, mirrors as metal, and all others as concrete.
    """
    words = re.split(r"[^a-z]+", material.name.casefold())
    named = [_FAMILY_OF_WORD[word] for word in words if word in _FAMILY_OF_WORD]
    lets_radar_in = material.penetrable or material.sheet_loss is not None
    if Family.FOLIAGE in named and lets_radar_in:
        return Family.FOLIAGE  # a "shrub_cloud" is no smoke
    if named:
        return named[-1]
    if lets_radar_in:
        return Family.FOLIAGE if material.solid else Family.SMOKE
    mirror = material.radar_mirror or material.laser_mirror
    return Family.METAL if mirror else Family.STONE


def colour_of(material: Material) -> str:
    """Return the colour of a material: that of its family."""
    return FAMILY_COLOURS[family_of(material)]


def sensor_colour(medium: str) -> str:
    """Return the colour of sensors of a medium, ``radar`` or ``laser``."""
    return RADAR if medium == "radar" else LASER


def paler(colour: str) -> str:
    """Return a colour mixed with white, for areas that marks are drawn on."""
    red, green, blue = (1 - PALE * (1 - part) for part in to_rgb(colour))
    return to_hex((red, green, blue))
