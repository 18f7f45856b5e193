"""``radarsim/GoTo-v0``: one robot that is to drive to a goal.

A scene from above with a robot and its goal, as an image.
"""

from typing import Any

import gymnasium
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from radarsim.addons.gym.environment import GoToTask
from radarsim.addons.gym.settings import GoToSettings, Transition
from radarsim.geometry import Floats, Pose2
from radarsim.plotting.plan import HEIGHT, draw_plan, draw_robot, show_extent
from radarsim.scene.scene import Scene

_SIZE = (6.0, 6.0)  # inches
_DPI = 100


class Picture:
    """The plan of a scene, onto which robots are drawn again and again."""

    def __init__(self, scene: Scene, robot: str) -> None:
        """Draw the plan.

        Args:
            scene: The map.
            robot: Class of the robots.
        """
        self._robot = robot
        figure = Figure(figsize=_SIZE, dpi=_DPI, layout="compressed")
        self._canvas = FigureCanvasAgg(figure)
        self._axes = figure.add_subplot()
        self._axes.set_axis_off()
        plan = draw_plan(self._axes, scene, scene.floor_at(0.0, 0.0) + HEIGHT)
        show_extent(self._axes, plan.corners)

    def draw(self, poses: Floats, goals: Floats) -> NDArray[np.uint8]:
        """Return the image, (H, W, 3).

        Args:
            poses: (3,) or (N, 3) x, y and yaw of the robots, m and rad, map frame.
            goals: (2,) or (N, 2) x and y of their goals, m, map frame.
        """
        drawn = [
            artist
            for pose in np.atleast_2d(poses)
            for artist in draw_robot(self._axes, self._robot, Pose2(*pose.tolist()))
        ]
        x, y = np.atleast_2d(goals).T
        stars = self._axes.plot(x, y, "*", color="black", markersize=14, zorder=4)
        data, (width, height) = self._canvas.print_to_buffer()  # type: ignore[no-untyped-call]
        image = np.frombuffer(data, np.uint8).reshape(height, width, 4)[..., :3].copy()
        for artist in (*drawn, *stars):
            artist.remove()
        return image


Observation = dict[str, NDArray[np.float32]]


class GoToEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """A robot in a scene, and a goal.

    An observation has ``ranges``, of the scanner's beams from right to left, as shares
    of its maximum range, with 1 where nothing is detected; ``goal``, its distance by
    20 m, limited to 1, and cosine and sine of its direction from the robot's heading;
    ``speeds``, forward and turning, as shares of the highest ones. An action is the
    speeds of the left and right wheels, as shares of the highest one.

    An episode terminates within 0.5 m of the goal. ``info`` has the ``distance`` to the
    goal, m, whether the robot ``touched`` something, and its true ``pose``, x, y and
    yaw, m and rad, map frame.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - so in the base class
        "render_modes": ["rgb_array"],
        "render_fps": 10,
    }

    def __init__(self, *, render_mode: str | None = None, **settings: Any) -> None:
        """Load the map.

        Args:
            render_mode: ``rgb_array``, or None for an environment without pictures.
            settings: As in ``GoToSettings``.

        Raises:
            RadarsimError: If the map, the class or a sensor setting is wrong.
            TypeError: If there is no such setting.
            ValueError: If another setting is wrong.
        """
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode {render_mode!r}, expected rgb_array or None")
        self.render_mode = render_mode
        self.task = GoToTask(GoToSettings(**settings))
        self.observation_space = self.task.observation_space
        self.action_space = self.task.action_space
        self._picture: Picture | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Seed of everything random from now on; None to go on.
            options: ``start`` and ``goal`` of this episode, as in the settings.

        Raises:
            ValueError: If an option is wrong, or there is no free place.
        """
        super().reset(seed=seed)
        self.task.reset(0, self.np_random, options)
        return self._observe(), self.task.info(0, np.zeros(1, np.bool_))

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for a decision period.

        Args:
            action: (2,) speeds of the left and right wheels, -1 to 1.

        Raises:
            ValueError: If the action is not finite.
        """
        transition: Transition = self.task.drive(np.asarray(action, np.float64)[None])
        reward = float(self.task.settings.reward(transition)[0])
        terminated, truncated = self.task.ended(transition)
        return (
            self._observe(),
            reward,
            bool(terminated[0]),
            bool(truncated[0]),
            self.task.info(0, transition.touched),
        )

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture of the scene from above, (H, W, 3); None without a mode."""
        if self.render_mode is None:
            return None
        if self._picture is None:
            self._picture = Picture(self.task.arena.scene, self.task.settings.robot)
        return self._picture.draw(self.task.arena.poses[0], self.task.goals[0])

    def _observe(self) -> Observation:
        rows = self.task.observe([self.np_random])
        return {name: values[0] for name, values in rows.items()}
