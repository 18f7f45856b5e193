"""What a navigator lets one choose, by name; nothing heavy is imported here."""

from enum import StrEnum
from typing import Final

ROBOT: Final = "P3AT_Radar360"  # a class that sees all around


class Algorithm(StrEnum):
    """How to get round what is in the way."""

    BUG1 = "bug1"
    BUG2 = "bug2"


class Rule(StrEnum):
    """When a bumper is pressed."""

    SHARE = "share"  # a share of its beams is nearer than the band's far end
    ALL = "all"  # all of its beams are within the band, as the thesis has it


class GiveUp(StrEnum):
    """When Bug2 says that there is no path."""

    HIT_POINT = "hit_point"  # it has come round to where it hit
    LINE = "line"  # it is at the line, and not nearer


class PoseSource(StrEnum):
    """Which reading the pose is taken from."""

    INS = "ins"
    ODOMETRY = "odometry"
    GROUND_TRUTH = "ground_truth"
