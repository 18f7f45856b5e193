"""A PettingZoo environment with several robots that detect and touch each other."""

from collections.abc import Mapping
from typing import Any, ClassVar, TypeAlias

import numpy as np
from gymnasium.spaces import Space
from gymnasium.utils.seeding import np_random
from numpy.typing import NDArray

from radarsim.addons.gym.environment import GoToSettings, GoToTask, as_actions
from radarsim.addons.gym.single import Observation, Picture
from radarsim.errors import import_optional

_Base: Any = import_optional("pettingzoo", extra="marl").ParallelEnv
_Rows: TypeAlias = dict[str, Any]  # values by agent


class ParallelEnv(_Base):  # type: ignore[misc] # PettingZoo has no types
    """Several robots in one scene, each of which has to drive to its own goal.

    Agents are ``robot_0``, ``robot_1`` and so on. Their observations and actions are
    those of ``GoToEnv``. A robot whose episode ends is removed from the scene.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "radarsim/GoTo-v0",
        "render_modes": ["rgb_array", "human"],
        "render_fps": 10,
    }

    def __init__(
        self, num_robots: int = 2, *, render_mode: str | None = None, **settings: Any
    ) -> None:
        """Load the map and create the robots.

        Args:
            num_robots: Number of robots.
            render_mode: ``rgb_array``; ``human`` for a window that follows the robots;
                None for an environment without pictures.
            settings: As in ``GoToSettings``; ``start`` must be ``random``, as robots
                cannot share a start.

        Raises:
            RadarsimError: If the map, the class or a sensor setting is wrong.
            TypeError: If a setting does not exist.
            ValueError: If another setting is wrong.
        """
        if num_robots < 1:
            raise ValueError(f"num_robots {num_robots!r}, expected at least 1")
        if settings.get("start", "random") != "random":
            raise ValueError(f"start {settings['start']!r}, expected random")
        self.render_mode = render_mode
        self.task = GoToTask(GoToSettings(**settings), num_robots, meets=True)
        self.possible_agents = [f"robot_{row}" for row in range(num_robots)]
        self.agents: list[str] = []
        self._rows = {name: row for row, name in enumerate(self.possible_agents)}
        self._rngs = [np_random()[0] for _ in range(num_robots)]
        self._picture = Picture(self.task, render_mode)
        self._spaces = self.task.observation_space, self.task.action_space

    def observation_space(self, agent: str) -> Space[Any]:  # noqa: ARG002
        """Return the observation space, which is the same for all robots."""
        return self._spaces[0]

    def action_space(self, agent: str) -> Space[Any]:  # noqa: ARG002
        """Return the action space, which is the same for all robots."""
        return self._spaces[1]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start a new episode with all robots.

        Args:
            seed: Seed of the first robot; each further robot has the next higher seed.
                None to continue the random numbers.
            options: ``goal``, as in the settings.

        Raises:
            ValueError: If an option is wrong, or no free position is found.
        """
        if "start" in (options or {}):
            raise ValueError("unknown option 'start': robots start at random")
        if seed is not None:
            self._rngs = [np_random(seed + row)[0] for row in range(len(self._rows))]
        self.agents = list(self.possible_agents)
        # Robots of the last episode are removed, so that they do not block positions in
        # the new episode.
        for row in range(len(self._rows)):
            self.task.arena.take_out(row)
        for row in range(len(self._rows)):
            self.task.reset(row, self._rngs[row], options)
        if self.render_mode == "human":
            self.render()
        touched = np.zeros(len(self._rows), np.bool_)
        return self._observe(self.agents), self._infos(self.agents, touched)

    def step(
        self, actions: Mapping[str, NDArray[np.float32]]
    ) -> tuple[dict[str, Observation], _Rows, _Rows, _Rows, _Rows]:
        """Drive all robots whose episodes have not ended for a decision period.

        Args:
            actions: Speeds of the left and right wheels of each robot, -1 to 1.

        Raises:
            KeyError: If the action of a robot is missing.
            ResetNeeded: If ``reset`` has not been called yet.
            ValueError: If an action has another shape, or is not finite.
        """
        agents = self.agents
        speeds = np.zeros((len(self._rows), 2))
        for agent in agents:
            speeds[self._rows[agent]] = as_actions(actions[agent], (2,))
        transition = self.task.drive(speeds)
        rewards = self.task.settings.reward(transition)
        terminated, truncated = self.task.ended(transition)
        # Robots observe before they are removed, so the last step of an episode returns
        # an observation.
        observations = self._observe(agents)
        ended = terminated | truncated
        for agent in agents:
            if ended[self._rows[agent]]:
                self.task.arena.take_out(self._rows[agent])
        self.agents = [each for each in agents if not ended[self._rows[each]]]
        if self.render_mode == "human":
            self.render()
        reward, end, cut = (
            {agent: column[self._rows[agent]].item() for agent in agents}
            for column in (rewards, terminated, truncated)
        )
        return observations, reward, end, cut, self._infos(agents, transition.touched)

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture of the scene from above, (H, W, 3), for ``rgb_array``."""
        return self._picture.draw([self._rows[agent] for agent in self.agents])

    def close(self) -> None:
        """Close the window of render mode ``human``."""
        self._picture.close()

    def _observe(self, agents: list[str]) -> dict[str, Observation]:
        rows = self.task.observe(self._rngs, np.ones(len(self._rows), np.bool_))
        return {
            agent: {name: values[self._rows[agent]] for name, values in rows.items()}
            for agent in agents
        }

    def _infos(
        self, agents: list[str], touched: NDArray[np.bool_]
    ) -> dict[str, dict[str, Any]]:
        return {agent: self.task.info(self._rows[agent], touched) for agent in agents}
