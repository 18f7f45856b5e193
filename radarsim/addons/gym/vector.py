"""Many robots that learn at once, in one scene, without meeting each other."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode
from gymnasium.vector import VectorEnv as GymnasiumVectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from radarsim.addons.gym.environment import GoToTask, Observations
from radarsim.addons.gym.settings import GoToSettings
from radarsim.geometry import Floats

Infos = dict[str, Any]


class VectorEnv(GymnasiumVectorEnv[Observations, NDArray[np.float32], NDArray[Any]]):
    """N times ``GoToEnv`` in one scene, whose scans are taken together.

    Robots neither see nor touch each other, so that each does what it would do in an
    environment of its own: sub-environment i has the seed of ``reset`` plus i. An
    episode that ended begins anew in the next step, whose action is ignored.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - so in the base class
        "render_modes": [],
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self, num_envs: int = 1, *, render_mode: str | None = None, **settings: Any
    ) -> None:
        """Load the map, or the maps.

        Args:
            num_envs: N.
            render_mode: None; there are no pictures.
            settings: As in ``GoToSettings``; ``map`` may be a list of maps, of which
                sub-environment i gets number i, and the first again after the last.

        Raises:
            RadarsimError: If a map, the class or a sensor setting is wrong.
            TypeError: If there is no such setting.
            ValueError: If another setting is wrong.
        """
        if num_envs < 1:
            raise ValueError(f"num_envs {num_envs!r}, expected at least 1")
        if render_mode is not None:
            raise ValueError(f"render_mode {render_mode!r}, expected None")
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
        self.single_observation_space = self._tasks[0].observation_space
        self.single_action_space = self._tasks[0].action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._rngs = [np_random()[0] for _ in range(num_envs)]
        self._ended = np.zeros(num_envs, np.bool_)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, Infos]:
        """Begin an episode everywhere.

        Args:
            seed: Seed of the first sub-environment, that of the next is one higher; or
                one for each; None to go on.
            options: ``start`` and ``goal``, as in the settings.

        Raises:
            ValueError: If an option is wrong, or there is no free place.
        """
        for i, each in enumerate(self._seeds(seed)):
            if each is not None:
                self._rngs[i] = np_random(each)[0]
        for task, rows in zip(self._tasks, self._rows, strict=False):
            for k, row in enumerate(rows.tolist()):
                task.reset(k, self._rngs[row], options)
        self._ended[:] = False
        return self._observe(), self._infos(np.zeros(self.num_envs, np.bool_))

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observations, NDArray[Any], NDArray[np.bool_], NDArray[np.bool_], Infos]:
        """Drive all robots for a decision period.

        Args:
            actions: (N, 2) speeds of the left and right wheels, -1 to 1.

        Raises:
            ValueError: If an action is not finite.
        """
        again = self._ended
        actions = np.where(again[:, None], 0.0, actions)
        rewards, touched, terminated, truncated = (
            np.zeros(self.num_envs, kind) for kind in (float, bool, bool, bool)
        )
        for task, rows in zip(self._tasks, self._rows, strict=False):
            transition = task.drive(actions[rows].astype(np.float64))
            rewards[rows] = task.settings.reward(transition)
            touched[rows] = transition.touched
            terminated[rows], truncated[rows] = task.ended(transition)
            # After driving, which moves robots that ended as well, but by an action of
            # 0.
            for k in np.flatnonzero(again[rows]).tolist():
                task.reset(k, self._rngs[rows[k]])
        # As Gymnasium asks of a step that only resets.
        for column in (rewards, touched, terminated, truncated):
            column[again] = 0
        self._ended = terminated | truncated
        return self._observe(), rewards, terminated, truncated, self._infos(touched)

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int):
            return [seed + i for i in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"{len(seed)} seeds, expected {self.num_envs}")
        return list(seed)

    def _observe(self) -> Observations:
        found: Observations = {}
        for task, rows in zip(self._tasks, self._rows, strict=False):
            for name, values in task.observe([self._rngs[r] for r in rows]).items():
                shape = (self.num_envs, *values.shape[1:])
                found.setdefault(name, np.zeros(shape, np.float32))[rows] = values
        return found

    def _infos(self, touched: NDArray[np.bool_]) -> Infos:
        distances, poses = np.zeros(self.num_envs), np.zeros((self.num_envs, 3))
        for task, rows in zip(self._tasks, self._rows, strict=False):
            distances[rows], poses[rows] = task.distances, task.arena.poses
        values: dict[str, Floats | NDArray[np.bool_]] = {
            "distance": distances,
            "touched": touched,
            "pose": poses,
        }
        present = {f"_{name}": np.ones(self.num_envs, np.bool_) for name in values}
        return {**values, **present}
