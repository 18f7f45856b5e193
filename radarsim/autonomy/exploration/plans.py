"""Plans of explorations; nothing heavy is imported here."""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, ClassVar

from annotated_types import Gt, Interval, Unit

from radarsim.autonomy.navigation.plans import DrivePlan, Metres, MotionSource
from radarsim.plans import RARE, Option, PointXY

RADIUS = 12.0  # m


class StrategyName(StrEnum):
    """How to explore."""

    AUTO = "auto"
    TURN_AWAY = "turn_away"
    CONTOUR = "contour"
    CENTRE_OUT = "centre_out"
    FRONTIERS = "frontiers"


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplorationPlan(DrivePlan):
    """An exploration; along waypoints the scanner need not cover a full circle.

    Attributes:
        strategy: Strategy of exploring.
        waypoints: Drive to this waypoint instead; several in turn.
        motion_source: Sensor from which the motion between scans is read.
        resolution: Side of a cell.
        map_range: Map only what is within this range of the scanner; its whole range by
            default. The pose is found with all of it.
        radius: Farthest distance from the start, where no walls are nearer.
    """

    option_group: ClassVar = "Exploration"
    at_most_one: ClassVar = (("start", "pose"), ("strategy", "waypoints"))

    strategy: StrategyName = StrategyName.AUTO
    waypoints: Annotated[tuple[PointXY, ...], Option(names=("--way",))] = ()
    motion_source: Annotated[
        MotionSource, Option(names=("--motion-from",), is_rare=True)
    ] = "ins"
    resolution: Annotated[float, Interval(ge=0.005, le=1), Unit("m")] = 0.05
    map_range: Annotated[float, Gt(0), Unit("m"), RARE] = math.inf
    radius: Annotated[Metres, RARE] = RADIUS
    speed: Annotated[float, Gt(0), Unit("m/s")] = 0.4
