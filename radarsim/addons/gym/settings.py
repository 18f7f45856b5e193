"""What environments can be told: the map, the robot, and what is rewarded."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.scene.scene import Scene

# What can be observed of each beam besides its range: smallest and largest value.
BEAM_VALUES: Final[Mapping[str, tuple[float, float]]] = {
    "power": (0.0, 1.0),
    "rays": (-1.0, 1.0),
}


class Transition(NamedTuple):
    """What happened to N robots in one decision period.

    Attributes:
        actions: (N, 2) wheel speeds that were chosen, left and right, -1 to 1.
        distances_before: (N,) m to the goal before it.
        distances: (N,) m to the goal after it.
        touched: (N,) whether the robot was blocked or touched anything.
        reached: (N,) whether it is within 0.5 m of its goal.
    """

    actions: Floats
    distances_before: Floats
    distances: Floats
    touched: NDArray[np.bool_]
    reached: NDArray[np.bool_]


def progress_reward(transition: Transition) -> Floats:
    """Return the way that was made towards the goal, m, and 10 for reaching it.

    A period in which a robot touches something costs 1.
    """
    progress = transition.distances_before - transition.distances
    reward: Floats = progress + 10.0 * transition.reached - 1.0 * transition.touched
    return reward


@dataclass(frozen=True, slots=True, kw_only=True)
class GoToSettings:
    """What ``gymnasium.make`` takes for ``radarsim/GoTo-v0``.

    Attributes:
        map: Name or file of a map, or a scene.
        robot: Class of the robot.
        scanner: Name of its scanner item; None for its first.
        sensor_settings: Settings of the scanner that differ from the class's.
        start: ``random``; ``map`` for that of the map's trial; the name of a start; or
            x, y and yaw, m and rad.
        goal: ``random``, a place that the robot can get to; ``map`` for that of the
            map's trial; or x and y, m.
        decision_period: Simulated time between two decisions, s.
        beam_values: What is observed of each beam besides its range: ``power``, the
            penetration power left where it reads, and ``rays``, which ray of it reads.
        max_steps: Decisions after which an episode is truncated.
        ends_at_collision: Whether an episode terminates when the robot touches
            something.
        reward: Computes the (N,) rewards of a ``Transition``.
    """

    map: str | Scene = "empty_room"
    robot: str = "P3AT"
    scanner: str | None = None
    sensor_settings: Mapping[str, Any] = field(default_factory=dict)
    start: str | Sequence[float] = "random"
    goal: str | Sequence[float] = "random"
    decision_period: float = 0.1
    beam_values: Sequence[str] = ()
    max_steps: int = 500
    ends_at_collision: bool = False
    reward: Callable[[Transition], Floats] = progress_reward

    def __post_init__(self) -> None:
        if self.max_steps < 1:
            raise ValueError(f"max_steps {self.max_steps!r}, expected at least 1")
        if not {*self.beam_values} <= {*BEAM_VALUES}:
            text = f"beam_values {self.beam_values!r}, expected some of"
            raise ValueError(f"{text} {list(BEAM_VALUES)}")
