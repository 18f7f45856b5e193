"""The named choices that a navigator offers; nothing heavy is imported here."""

from enum import StrEnum
from typing import Final

ROBOT: Final = "P3AT_Radar360"  # a robot class whose scanner covers a full circle


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
    """The sensor that poses are taken from."""

    INS = "ins"
    ODOMETRY = "odometry"
    GROUND_TRUTH = "ground_truth"
