"""What a surveyor lets one choose, by name; nothing heavy is imported here."""

from enum import StrEnum


class StrategyName(StrEnum):
    """How to explore."""

    AUTO = "auto"
    TURN_AWAY = "turn_away"
    CONTOUR = "contour"
    CENTRE_OUT = "centre_out"
    FRONTIERS = "frontiers"
