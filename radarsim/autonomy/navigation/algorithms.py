"""The algorithms by name, and the named choices that they leave open.

A new algorithm is a subclass of ``Controller``, and has a member of ``Algorithm`` here
and a class in ``mission.CONTROLLERS``. Command lines offer these names: nothing heavy
is imported here.
"""

from enum import StrEnum
from typing import Final

ROBOT: Final = "P3AT_Radar360"  # a robot class whose scanner covers a full circle
ROBOT_RADIUS: Final = 0.37  # m; half the diagonal of a P3AT


class Algorithm(StrEnum):
    """How to get around obstacles."""

    BUG1 = "bug1"
    BUG2 = "bug2"
    TANGENT_BUG = "tangentbug"  # by the edges of obstacles that scans show
    PLANNED = "planned"  # shortest path on the map as it is seen


class Rule(StrEnum):
    """When a bumper is pressed, and what boundaries are followed by."""

    SHARE = "share"  # a share of its beams is nearer than the far end of the band
    ALL = "all"  # all of its beams are within the band, as in the thesis
    THESIS = "thesis"  # the same, and boundaries are followed by bumpers alone


class GiveUp(StrEnum):
    """When Bug2 concludes that there is no path."""

    HIT_POINT = "hit_point"  # back at the hit point
    LINE = "line"  # at the line to the goal, but no nearer to the goal


class PoseSource(StrEnum):
    """Where poses are taken from."""

    INS = "ins"
    ODOMETRY = "odometry"
    GROUND_TRUTH = "ground_truth"
    SLAM = "slam"  # scans matched with those before, and the motion of an INS
