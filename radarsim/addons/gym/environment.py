"""The task of all environments: drive to a goal, using the readings of a scanner.

All state is in arrays with one row for each robot, so one robot and many robots share
the same code. Random starts and goals are drawn from the floor that robots can reach.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
import shapely
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import ArrayLike, NDArray
from shapely import MultiPolygon, Polygon

from radarsim.addons.gym.arena import Arena
from radarsim.geometry import Floats, Pose2
from radarsim.scene.scene import Scene, Trial
from radarsim.simulation.map_warnings import Position, component_around, free_space

# Smallest and largest value of each optional observation of a beam. The range of a beam
# is always observed.
BEAM_VALUES: Final[Mapping[str, tuple[float, float]]] = {
    "power": (0.0, 1.0),
    "rays": (-1.0, 1.0),
}


class Transition(NamedTuple):
    """The result of a decision period: actions, distances and contacts of N robots.

    Attributes:
        actions: (N, 2) chosen wheel speeds, left and right, -1 to 1.
        distances_before: (N,) distance to the goal before the period, m.
        distances: (N,) distance to the goal after the period, m.
        touched: (N,) whether the robot was blocked or touched anything.
        reached: (N,) whether the robot is within 0.5 m of its goal.
    """

    actions: Floats
    distances_before: Floats
    distances: Floats
    touched: NDArray[np.bool_]
    reached: NDArray[np.bool_]


def progress_reward(transition: Transition) -> Floats:
    """Return the progress towards the goal, m, plus 10 if the robot has reached it.

    A period in which a robot touches something costs 1.
    """
    progress = transition.distances_before - transition.distances
    reward: Floats = progress + 10.0 * transition.reached - 1.0 * transition.touched
    return reward


@dataclass(frozen=True, slots=True, kw_only=True)
class GoToSettings:
    """Keyword arguments of ``gymnasium.make`` for ``radarsim/GoTo-v0``.

    Attributes:
        map: Name or path of a map, or a scene.
        robot: Class of the robot.
        scanner: Name of the scanner item; None for the first scanner of the robot.
        sensor_settings: Changed settings of the scanner.
        start: ``random``; ``map`` for the start of the map's trial; the name of a
            start; or x, y and yaw, m and rad.
        goal: ``random`` for a random reachable position; ``map`` for the goal of the
            map's trial; or x and y, m.
        decision_period: Simulated time between two decisions, s.
        beam_values: Further observations of each beam: ``power``, the share of
            penetration power left at its range, and ``rays``, the ray with that range.
        max_steps: Number of decisions after which an episode is truncated.
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


_DRAWN_TOGETHER: Final = 16  # positions in a draw; the first free position is used
_MAX_DRAWS: Final = 1000  # draws before an error is raised


class FreePlaces:
    """The connected pieces of floor on which a robot fits at any heading.

    Only pieces that contain a start of the map are used, or the origin if the map has
    no starts. This excludes the floor outside the walls of a room.
    """

    def __init__(self, scene: Scene, clearance: float) -> None:
        """Find the free floor of a map.

        Args:
            scene: The map.
            clearance: Least distance of positions from solid objects, m.

        Raises:
            ValueError: If no start of the map is on free floor.
        """
        free = free_space(scene, clearance)
        starts = [(start.pose.x, start.pose.y) for start in scene.starts]
        found = [component_around(free, place) for place in starts or [(0.0, 0.0)]]
        # Several starts may be on the same piece of floor, which is listed only once.
        pieces = {piece.wkb: piece for piece in found if piece is not None}
        if not pieces:
            raise ValueError(
                f"map {scene.name!r}: no start has {clearance:.2f} m of free floor"
                " around it, expected at least one such start"
            )
        self._pieces = tuple(pieces.values())
        self._floor = MultiPolygon(self._pieces)
        # Prepared shapely geometries have an index, which makes many point tests fast.
        shapely.prepare([self._floor, *self._pieces])

    def draw(
        self,
        rng: np.random.Generator,
        others: Sequence[Position],
        distance: float,
        *,
        reached_from: Position | None = None,
    ) -> Position:
        """Draw a random position, x and y, m, uniformly distributed over the floor.

        Args:
            rng: Random generator.
            others: Positions to keep away from, m.
            distance: Least distance from ``others``, m.
            reached_from: Position from which the drawn position can be reached, m; None
                for any position.

        Raises:
            ValueError: If no free position is found.
        """
        floor: Polygon | MultiPolygon = self._floor
        if reached_from is not None:
            point = shapely.Point(reached_from)
            floor = next((p for p in self._pieces if p.covers(point)), floor)
        low, high = np.reshape(floor.bounds, (2, 2))
        near = np.reshape(others, (-1, 1, 2))
        for _ in range(_MAX_DRAWS):
            # Rejection sampling from the bounding box is uniform on the floor. Many
            # positions are drawn at once, because each call of shapely is slow.
            places = rng.uniform(low, high, (_DRAWN_TOGETHER, 2))
            gaps = np.hypot(*(places - near).T)
            is_far = (gaps >= distance).all(axis=1)
            is_free = shapely.contains_xy(floor, *places.T) & is_far
            if is_free.any():
                x, y = places[is_free.argmax()].tolist()
                return x, y
        raise ValueError(
            f"{_MAX_DRAWS * _DRAWN_TOGETHER} random positions: none is free and at"
            f" least {distance:g} m away from {len(others)} other positions"
        )


GOAL_RADIUS: Final = 0.5  # m; distance within which the goal is reached
GOAL_SCALE: Final = 20.0  # m; distance to the goal that is observed as 1
MIN_DISTANCE: Final = 1.0  # m; least distance of a random goal from the start
CLEARANCE: Final = 0.05  # m; free space around a robot at a random start

Observations: TypeAlias = dict[str, NDArray[np.float32]]


def as_actions(actions: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Return the actions of robots as an array of float64, after a check of its shape.

    Raises:
        ValueError: If the array does not have this shape.
    """
    array = np.asarray(actions, np.float64)
    if array.shape != shape:
        raise ValueError(f"action of shape {array.shape}, expected {shape}")
    return array


class GoToTask:
    """N robots, each of which has to drive to its goal.

    Attributes:
        settings: The settings.
        arena: The scene with the robots.
        goals: (N, 2) x and y of the goals, m, map frame.
        distances: (N,) distances from the robots to their goals, m.
        steps: (N,) number of decisions since the last reset.
    """

    def __init__(
        self, settings: GoToSettings, count: int = 1, *, meets: bool = False
    ) -> None:
        """Load the map; call ``reset`` for each robot before ``drive``.

        Args:
            settings: The settings.
            count: Number of robots, N.
            meets: Whether the robots see and touch each other.

        Raises:
            RadarsimError: If the map, the class or a sensor setting is wrong.
            ValueError: If another setting is wrong.
        """
        self.settings = settings
        self.arena = Arena(settings, count, meets=meets)
        # These calls check the settings, so that wrong settings fail here and not in
        # the first reset.
        _start_pose(self.arena.scene, settings.start)
        _goal_position(self.arena.scene, settings.goal)
        self.goals = np.zeros((count, 2))
        self.distances = np.zeros(count)
        self.steps = np.zeros(count, np.int64)
        self._speeds = np.zeros((count, 2))
        self._is_placed = np.zeros(count, np.bool_)

    @property
    def observation_space(self) -> spaces.Space[Any]:
        """The Gymnasium space of one robot's observation."""
        beams = len(self.arena.scanner.angles)
        low, high = np.array([0, -1, -1], np.float32), np.ones(3, np.float32)
        values = {name: BEAM_VALUES[name] for name in self.settings.beam_values}
        return spaces.Dict(
            {
                "ranges": spaces.Box(0.0, 1.0, (beams,), np.float32),
                "goal": spaces.Box(low, high, dtype=np.float32),
                "speeds": spaces.Box(-1.0, 1.0, (2,), np.float32),
                **{
                    name: spaces.Box(least, most, (beams,), np.float32)
                    for name, (least, most) in values.items()
                },
            }
        )

    @property
    def action_space(self) -> spaces.Space[Any]:
        """The actions: speeds of the left and right wheels, relative to the maximum."""
        return spaces.Box(-1.0, 1.0, (2,), np.float32)

    def reset(
        self,
        row: int,
        rng: np.random.Generator,
        options: Mapping[str, Any] | None = None,
    ) -> None:
        """Place a robot at a start, and set its goal.

        Args:
            row: Index of the robot.
            rng: Random generator.
            options: ``start`` and ``goal`` of this episode, as in the settings; other
                keys are ignored.

        Raises:
            ValueError: If a start or goal is wrong, or no free position is found.
        """
        options, settings = options or {}, self.settings
        start = _start_pose(self.arena.scene, options.get("start", settings.start))
        goal = _goal_position(self.arena.scene, options.get("goal", settings.goal))
        if start is None:
            others = self.arena.places_of_others(row)
            apart = 2 * (self.arena.radius + CLEARANCE)
            x, y = self._free_places.draw(rng, others, apart)
            pose = Pose2(x, y, float(rng.uniform(-math.pi, math.pi)))
        else:
            pose = self.arena.nearest_free_pose(start)
        self.arena.place(row, pose)
        place = (pose.x, pose.y)
        if goal is None:
            goal = self._free_places.draw(
                rng, [place], MIN_DISTANCE, reached_from=place
            )
        self.goals[row] = goal
        self.distances[row] = math.dist(goal, place)
        self.steps[row] = 0
        self._speeds[row] = 0.0
        self._is_placed[row] = True

    def drive(self, actions: Floats) -> Transition:
        """Let all robots drive for a decision period.

        Args:
            actions: (N, 2) wheel speeds, which are clipped to -1 to 1.

        Raises:
            ResetNeeded: If a robot has not been reset yet.
            ValueError: If an action is not finite.
        """
        if not self._is_placed.all():
            raise ResetNeeded("step() was called before reset()")
        if not np.isfinite(actions).all():
            raise ValueError(f"actions {actions.tolist()}, expected finite numbers")
        actions = np.clip(np.asarray(actions, np.float64), -1.0, 1.0)
        before, poses = self.distances, self.arena.poses
        touched = self.arena.drive(actions)
        self.steps += 1
        x, y, yaw = (self.arena.poses - poses).T
        # On an arc, the chord points halfway between the first and the last heading.
        heading = poses[:, 2] + yaw / 2
        forward = x * np.cos(heading) + y * np.sin(heading)
        # The difference of two headings is wrapped to -pi to pi.
        turned = np.arctan2(np.sin(yaw), np.cos(yaw))
        limits = np.array([self.arena.max_speed, self.arena.max_turn_rate])
        speeds = np.column_stack([forward, turned]) / self.settings.decision_period
        self._speeds = np.clip(speeds / limits, -1.0, 1.0)
        distances = np.hypot(*(self.goals - self.arena.poses[:, :2]).T)
        # ``reset`` changes ``self.distances``, so the transition needs its own array.
        self.distances = distances.copy()
        reached = distances <= GOAL_RADIUS
        return Transition(actions, before, distances, touched, reached)

    def observe(
        self, rngs: Sequence[np.random.Generator], chosen: NDArray[np.bool_]
    ) -> Observations:
        """Return the observations of all robots, as arrays (N, ...).

        Args:
            rngs: Random generator of each robot.
            chosen: (N,) whether a robot scans; rows of the other robots are undefined.
        """
        names = self.settings.beam_values
        read = self.arena.scan(rngs, chosen, names)
        x, y, yaw = self.arena.poses.T
        bearing = np.arctan2(self.goals[:, 1] - y, self.goals[:, 0] - x) - yaw
        distance = np.minimum(self.distances / GOAL_SCALE, 1.0)
        # The angle jumps by 2 pi behind the robot, whereas its cosine and sine are
        # continuous.
        goal = np.column_stack([distance, np.cos(bearing), np.sin(bearing)])
        return {
            "ranges": np.clip(
                read["ranges"] / self.arena.scanner.settings.max_range, 0.0, 1.0
            ).astype(np.float32),
            "goal": goal.astype(np.float32),
            "speeds": self._speeds.astype(np.float32),
            **{name: read[name].astype(np.float32) for name in names},
        }

    def ended(self, transition: Transition) -> tuple[NDArray[np.bool_], ...]:
        """Return whether each episode is terminated, (N,), and truncated, (N,)."""
        terminated = transition.reached.copy()
        if self.settings.ends_at_collision:
            terminated |= transition.touched
        return terminated, self.steps >= self.settings.max_steps

    def info(self, row: int, touched: NDArray[np.bool_]) -> dict[str, Any]:
        """Return the dictionary ``info`` of a robot, as Gymnasium defines it.

        Args:
            row: Index of the robot.
            touched: (N,) whether each robot touched something.
        """
        return {
            "distance": float(self.distances[row]),
            "touched": bool(touched[row]),
            "pose": self.arena.poses[row].copy(),
        }

    @cached_property
    def _free_places(self) -> FreePlaces:
        return FreePlaces(self.arena.scene, self.arena.radius + CLEARANCE)


def _start_pose(scene: Scene, start: str | Sequence[float]) -> Pose2 | None:
    """Return the start pose that a setting requests, or None for a random start."""
    if not isinstance(start, str):
        return Pose2(*_finite_numbers(start, 3, "start", "x, y and yaw"))
    if start == "random":
        return None
    name = _trial(scene).start if start == "map" else start
    found = scene.start(name)
    if found is None:
        known = ", ".join(each.name for each in scene.starts)
        raise ValueError(
            f"start {start!r}, expected random, map, x, y and yaw, or one of: {known}"
        )
    return Pose2(found.pose.x, found.pose.y, found.pose.yaw)


def _goal_position(scene: Scene, goal: str | Sequence[float]) -> Sequence[float] | None:
    """Return x and y, m, of the goal that a setting requests, or None if random."""
    if not isinstance(goal, str):
        return _finite_numbers(goal, 2, "goal", "x and y")
    if goal == "random":
        return None
    if goal == "map":
        return _trial(scene).goal
    raise ValueError(f"goal {goal!r}, expected random, map, or x and y")


def _trial(scene: Scene) -> Trial:
    if scene.trial is None:
        raise ValueError(f"map {scene.name!r} has no trial with a start and a goal")
    return scene.trial


def _finite_numbers(
    values: Sequence[float], count: int, name: str, expected: str
) -> list[float]:
    numbers = np.asarray(values, np.float64)
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise ValueError(f"{name} {values!r}, expected {expected}, finite numbers")
    return [float(number) for number in numbers]
