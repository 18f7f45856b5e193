"""A vectorized environment, in which many robots ignore each other in one scene."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode
from gymnasium.vector import VectorEnv as GymnasiumVectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from radarsim.addons.gym.environment import (
    GoToSettings,
    GoToTask,
    Observations,
    as_actions,
)
from radarsim.addons.gym.single import Picture
from radarsim.geometry import Floats

Infos = dict[str, Any]


class VectorEnv(GymnasiumVectorEnv[Observations, NDArray[np.float32], NDArray[Any]]):
    """N environments of ``GoToEnv`` in one scene, whose scans are computed together.

    Robots neither see nor touch each other, so each behaves as in a separate
    environment. The seed of environment i is that of ``reset`` plus i. After the end of
    an episode, the next step starts a new episode and ignores the action.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - as in the base class
        "render_modes": ["rgb_array"],
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self, num_envs: int = 1, *, render_mode: str | None = None, **settings: Any
    ) -> None:
        """Load the map or the maps, and create the robots.

        Args:
            num_envs: Number of environments, N.
            render_mode: ``rgb_array``, or None for environments without pictures.
            settings: As in ``GoToSettings``. ``map`` may be a list of maps, over which
                the environments cycle.

        Raises:
            RadarsimError: If a map, the class or a sensor setting is wrong.
            TypeError: If a setting does not exist.
            ValueError: If another setting is wrong.
        """
        if num_envs < 1:
            raise ValueError(f"num_envs {num_envs!r}, expected at least 1")
        if render_mode == "human":
            raise ValueError("render_mode 'human', expected rgb_array or None")
        self.num_envs, self.render_mode = num_envs, render_mode
        maps = settings.pop("map", GoToSettings().map)
        maps = (
            [maps] if isinstance(maps, str) or not isinstance(maps, Sequence) else maps
        )
        self._rows = [np.arange(k, num_envs, len(maps)) for k in range(len(maps))]
        self._tasks = [
            GoToTask(GoToSettings(map=map_, **settings), len(rows))
            for map_, rows in zip(maps, self._rows, strict=True)
            if len(rows)
        ]
        self._pictures = [Picture(task, render_mode) for task in self._tasks]
        self.single_observation_space = self._tasks[0].observation_space
        self.single_action_space = self._tasks[0].action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._rngs = [np_random()[0] for _ in range(num_envs)]
        self._ended = np.zeros(num_envs, np.bool_)
        self._observations: Observations = {}

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, Infos]:
        """Start an episode in all environments, or in the environments of a mask.

        Args:
            seed: Seed of the first environment; each further environment has the next
                higher seed. Or a list of seeds, or None to continue.
            options: ``start`` and ``goal``, as in the settings, and ``reset_mask``, an
                array (N,) of bool. An episode starts only where it is true. The other
                environments return their last observation, and no information.

        Raises:
            ResetNeeded: If the mask is used before all environments were reset.
            ValueError: If an option is wrong, or no free position is found.
        """
        mask = self._reset_mask(options or {})
        for i, each in enumerate(self._seeds(seed)):
            if each is not None and mask[i]:
                self._rngs[i] = np_random(each)[0]
        for task, rows in zip(self._tasks, self._rows, strict=False):
            for k in np.flatnonzero(mask[rows]).tolist():
                task.reset(k, self._rngs[rows[k]], options)
        self._ended[mask] = False
        touched = np.zeros(self.num_envs, np.bool_)
        return self._observe(mask), self._infos(touched, mask)

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observations, NDArray[Any], NDArray[np.bool_], NDArray[np.bool_], Infos]:
        """Let all robots drive for a decision period.

        Args:
            actions: (N, 2) speeds of the left and right wheels, -1 to 1.

        Raises:
            ResetNeeded: If ``reset`` has not been called yet.
            ValueError: If actions have another shape, or are not finite.
        """
        again = self._ended
        speeds = as_actions(actions, (self.num_envs, 2))
        speeds = np.where(again[:, None], 0.0, speeds)
        rewards, touched, terminated, truncated = (
            np.zeros(self.num_envs, kind) for kind in (float, bool, bool, bool)
        )
        for task, rows in zip(self._tasks, self._rows, strict=False):
            transition = task.drive(speeds[rows])
            rewards[rows] = task.settings.reward(transition)
            touched[rows] = transition.touched
            terminated[rows], truncated[rows] = task.ended(transition)
            # Robots with ended episodes drove with the action 0, and are reset now.
            for k in np.flatnonzero(again[rows]).tolist():
                task.reset(k, self._rngs[rows[k]])
        # Gymnasium requires zeros in a step that only resets an environment.
        for column in (rewards, touched, terminated, truncated):
            column[again] = 0
        self._ended = terminated | truncated
        everywhere = np.ones(self.num_envs, np.bool_)
        infos = self._infos(touched, everywhere)
        return self._observe(everywhere), rewards, terminated, truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return a picture of each environment, (H, W, 3), or None without render mode.

        Each picture shows only the robot of its environment.
        """
        images = {
            row: image
            for picture, rows in zip(self._pictures, self._rows, strict=False)
            for k, row in enumerate(rows.tolist())
            if (image := picture.draw([k])) is not None
        }
        return tuple(images[row] for row in sorted(images)) or None

    def _reset_mask(self, options: Mapping[str, Any]) -> NDArray[np.bool_]:
        if "reset_mask" not in options:
            return np.ones(self.num_envs, np.bool_)
        mask = np.asarray(options["reset_mask"])
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            text = f"reset_mask of shape {mask.shape} and type {mask.dtype}"
            expected = f"shape ({self.num_envs},), type bool, at least one true"
            raise ValueError(f"{text}, expected {expected}")
        if not self._observations and not mask.all():
            raise ResetNeeded("reset_mask before the first reset of all environments")
        return mask

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int):
            return [seed + i for i in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"{len(seed)} seeds, expected {self.num_envs}")
        return list(seed)

    def _observe(self, mask: NDArray[np.bool_]) -> Observations:
        """Update the observations of some environments; return all observations."""
        for task, rows in zip(self._tasks, self._rows, strict=False):
            chosen = mask[rows]
            if not chosen.any():  # no environment of this map
                continue
            seen = task.observe([self._rngs[row] for row in rows], chosen)
            for name, values in seen.items():
                shape = (self.num_envs, *values.shape[1:])
                kept = self._observations.setdefault(name, np.zeros(shape, np.float32))
                kept[rows[chosen]] = values[chosen]
        return {name: values.copy() for name, values in self._observations.items()}

    def _infos(self, touched: NDArray[np.bool_], mask: NDArray[np.bool_]) -> Infos:
        """Return ``info`` of the environments in a mask; other environments have 0."""
        distances, poses = np.zeros(self.num_envs), np.zeros((self.num_envs, 3))
        for task, rows in zip(self._tasks, self._rows, strict=False):
            distances[rows], poses[rows] = task.distances, task.arena.poses
        values: dict[str, Floats | NDArray[np.bool_]] = {
            "distance": distances,
            "touched": touched,
            "pose": poses,
        }
        for column in values.values():
            column[~mask] = 0
        return {**values, **{f"_{name}": mask.copy() for name in values}}
