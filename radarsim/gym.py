"""Environments for reinforcement learning: an alias of ``radarsim.addons.gym``.

Importing this module registers the environments of radarsim with Gymnasium.
"""

from typing import TYPE_CHECKING, Any

from radarsim.plugins import import_part

if TYPE_CHECKING:
    from radarsim.addons.gym import (
        GoToEnv,
        GoToSettings,
        ParallelEnv,
        Transition,
        VectorEnv,
        progress_reward,
    )

__all__ = [
    "GoToEnv",
    "GoToSettings",
    "ParallelEnv",
    "Transition",
    "VectorEnv",
    "progress_reward",
]


_gym = import_part("radarsim.addons.gym")


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(_gym, name)
