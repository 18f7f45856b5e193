"""Environments for reinforcement learning with Gymnasium and PettingZoo.

A robot has to drive to a goal: it observes the ranges of its scanner, and sets two
wheel speeds. Importing this package registers ``radarsim/GoTo-v0``,
``radarsim/Hedge-v0`` with a hedge between start and goal, and ``radarsim/Smoke-v0`` in
a room with smoke::

    env = gymnasium.make("radarsim.gym:radarsim/GoTo-v0", map="foliage_room")

Import it under its short name, ``radarsim.gym``.

In a checkout, ``pip install '.[gym]'`` installs Gymnasium, and
``pip install '.[marl]'`` installs PettingZoo.
"""

import importlib
from typing import TYPE_CHECKING, Any

from radarsim.errors import import_optional

gymnasium = import_optional("gymnasium", extra="gym")

from radarsim.addons.gym.environment import GoToSettings, Transition, progress_reward  # noqa: E402
from radarsim.addons.gym.single import GoToEnv  # noqa: E402 - it needs Gymnasium
from radarsim.addons.gym.vector import VectorEnv  # noqa: E402

if TYPE_CHECKING:
    from radarsim.addons.gym.parallel import ParallelEnv

__all__ = [
    "GoToEnv",
    "GoToSettings",
    "ParallelEnv",
    "Transition",
    "VectorEnv",
    "progress_reward",
]

_TASKS: dict[str, dict[str, Any]] = {
    "radarsim/GoTo-v0": {},
    "radarsim/Hedge-v0": {"map": "hedge_garden", "start": "map", "goal": "map"},
    "radarsim/Smoke-v0": {"map": "smoke_room"},
}
for _name, _settings in _TASKS.items():
    gymnasium.register(
        _name,
        entry_point="radarsim.addons.gym.single:GoToEnv",
        vector_entry_point="radarsim.addons.gym.vector:VectorEnv",
        kwargs=_settings,
    )


def __getattr__(name: str) -> Any:
    if name == "ParallelEnv":  # PettingZoo belongs to another extra
        return importlib.import_module("radarsim.addons.gym.parallel").ParallelEnv
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
