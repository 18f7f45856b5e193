"""Environments for reinforcement learning: an alias of ``radarsim.addons.gym``.

Importing this module registers the environments of radarsim with Gymnasium.
"""

import sys
from typing import TYPE_CHECKING

from radarsim.plugins import import_part

if TYPE_CHECKING:
    from radarsim.addons.gym import *  # noqa: F403 - its public names

sys.modules[__name__] = import_part("radarsim.addons.gym")
