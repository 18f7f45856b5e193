"""``radarsim/GoTo-v0``: one robot that has to drive to a goal, and its rendering."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import gymnasium
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from radarsim.addons.gym.environment import (
    GoToSettings,
    GoToTask,
    Transition,
    as_actions,
)
from radarsim.geometry import Pose2
from radarsim.plotting.palette import TARGET
from radarsim.plotting.plan import HEIGHT, draw_plan, draw_robot, show_extent
from radarsim.plotting.window import Window

_SIZE = (6.0, 6.0)  # in inches
_DPI = 100


class Picture:
    """Draws a task's robots and goals on the plan of the scene, seen from above."""

    def __init__(self, task: GoToTask, render_mode: str | None) -> None:
        """Open the window of render mode ``human``.

        Args:
            task: The task.
            render_mode: ``rgb_array``, ``human``, or None for no pictures.

        Raises:
            RadarsimError: If matplotlib cannot open a window.
            ValueError: If there is no such mode.
        """
        if render_mode not in (None, "rgb_array", "human"):
            text = f"render_mode {render_mode!r}, expected rgb_array, human or None"
            raise ValueError(text)
        self._task, self._has_pictures = task, render_mode is not None
        self._window: Window | None = None
        if render_mode == "human":
            self._window = Window(_SIZE, 'render_mode="rgb_array"')
        self._drawn: list[Artist] = []

    @cached_property
    def _axes(self) -> Axes:
        scene = self._task.arena.scene
        if self._window is not None:
            figure = self._window.figure
        else:
            figure = Figure(figsize=_SIZE, dpi=_DPI, layout="compressed")
            self._canvas = FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        axes.set_axis_off()
        _, corners = draw_plan(axes, scene, scene.floor_at(0.0, 0.0) + HEIGHT)
        show_extent(axes, corners)
        return axes

    def draw(self, rows: Sequence[int]) -> NDArray[np.uint8] | None:
        """Draw robots and their goals; show the picture, or return it as (H, W, 3)."""
        if not self._has_pictures:
            return None
        # Drawing the plan is slow, so it stays and only robots and goals are drawn
        # again.
        for artist in self._drawn:
            artist.remove()
        robot, axes = self._task.settings.robot, self._axes
        self._drawn = [
            artist
            for pose in self._task.arena.poses[rows]
            for artist in draw_robot(axes, robot, Pose2(*pose.tolist()))
        ]
        x, y = self._task.goals[rows].T
        self._drawn += axes.plot(x, y, "*", color=TARGET, markersize=14, zorder=4)
        if self._window is not None:
            self._window.refresh()
            return None
        data, (width, height) = self._canvas.print_to_buffer()  # type: ignore[no-untyped-call]
        # The image is copied, because the next picture is drawn into the same buffer.
        return np.frombuffer(data, np.uint8).reshape(height, width, 4)[..., :3].copy()

    def close(self) -> None:
        """Close the window of the picture, if there is one."""
        if self._window is not None:
            self._window.close()


Observation = dict[str, NDArray[np.float32]]


class GoToEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """A robot that has to drive to a goal in a scene.

    An observation has ``ranges`` of the scanner's beams from right to left, as shares
    of the maximum range, 1 without detection; ``goal``, the distance divided by 20 m,
    limited to 1, and the cosine and sine of the goal's bearing from the robot's
    heading; ``speeds``, forward speed and turn rate as shares of the highest values. An
    action sets the left and right wheel speeds as shares of the highest speed.

    An episode terminates within 0.5 m of the goal. ``info`` has the ``distance`` to the
    goal, m, whether the robot ``touched`` something, and its true ``pose``: x, y and
    yaw, m and rad, map frame.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - as in the base class
        "render_modes": ["rgb_array", "human"],
        "render_fps": 10,
    }

    def __init__(self, *, render_mode: str | None = None, **settings: Any) -> None:
        """Load the map and create the robot.

        Args:
            render_mode: ``rgb_array``; ``human`` for a window that follows the robot;
                None for an environment without pictures.
            settings: As in ``GoToSettings``.

        Raises:
            RadarsimError: If the map, the class or a sensor setting is wrong.
            TypeError: If a setting does not exist.
            ValueError: If another setting is wrong.
        """
        self.render_mode = render_mode
        self.task = GoToTask(GoToSettings(**settings))
        self.observation_space = self.task.observation_space
        self.action_space = self.task.action_space
        self._picture = Picture(self.task, render_mode)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start a new episode.

        Args:
            seed: Seed of all random numbers from now on; None to continue them.
            options: ``start`` and ``goal`` of this episode, as in the settings.

        Raises:
            ValueError: If an option is wrong, or no free position is found.
        """
        super().reset(seed=seed)
        self.task.reset(0, self.np_random, options)
        if self.render_mode == "human":
            self.render()
        return self._observe(), self.task.info(0, np.zeros(1, np.bool_))

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Let the robot drive for a decision period.

        Args:
            action: (2,) speeds of the left and right wheels, -1 to 1.

        Raises:
            ResetNeeded: If ``reset`` has not been called yet.
            ValueError: If the action has another shape, or is not finite.
        """
        transition: Transition = self.task.drive(as_actions(action, (2,))[None])
        reward = float(self.task.settings.reward(transition)[0])
        terminated, truncated = self.task.ended(transition)
        if self.render_mode == "human":
            self.render()
        return (
            self._observe(),
            reward,
            bool(terminated[0]),
            bool(truncated[0]),
            self.task.info(0, transition.touched),
        )

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture of the scene from above, (H, W, 3), for ``rgb_array``."""
        return self._picture.draw([0])

    def close(self) -> None:
        """Close the window of render mode ``human``."""
        self._picture.close()

    def _observe(self) -> Observation:
        rows = self.task.observe([self.np_random], np.ones(1, np.bool_))
        return {name: values[0] for name, values in rows.items()}
