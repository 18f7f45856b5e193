"""Names of exploration strategies, for command lines; imports nothing heavy."""

from enum import StrEnum


class StrategyName(StrEnum):
    """How to explore."""

    AUTO = "auto"
    TURN_AWAY = "turn_away"
    CONTOUR = "contour"
    CENTRE_OUT = "centre_out"
    FRONTIERS = "frontiers"
