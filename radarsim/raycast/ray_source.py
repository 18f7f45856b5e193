"""Where the rays of a call come from, as the kernel takes it: packed into one array.

Either all rays are given, or the beams of a sensor, of which scans have rays.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numba import types

from radarsim.jit import njit_cached
from radarsim.raycast.aimed_rays import NodeTable
from radarsim.raycast.packed_arrays import PackedArrays, pack, unpacker
from radarsim.raycast.rays import RayColumns

NO_TABLE: Final = NodeTable(
    *(np.zeros((0, 0, 3)), np.zeros((0, 0, 3)), np.zeros(0), np.zeros(0, np.int8))
)
# The leaves of a packed source: their types, and the numbers of their dimensions.
LEAVES: Final = (
    *((types.float64, 2), (types.float64, 2), (types.float64, 1), (types.float64, 1)),
    *((types.uint8, 1), (types.int64, 1)),
    *((types.float64, 3), (types.float64, 3), (types.float64, 1), (types.int8, 1)),
    (types.float64, 0),
)


class RaySource(NamedTuple):
    """Where rays come from.

    Attributes:
        rays: The rays; for scans one row with what their rays have in common.
        table: The nodes of all beams of the sensor; empty for given rays.
        radius: m, the largest distance from the sensor at which a ray starts.
    """

    rays: RayColumns
    table: NodeTable
    radius: float


def pack_source(
    rays: RayColumns, table: NodeTable = NO_TABLE, radius: float = 0.0
) -> PackedArrays:
    """Pack a source; arguments as the attributes of ``RaySource``."""
    return pack((*rays, *table, radius), LEAVES)


_leaves_of: Any = unpacker(LEAVES)


@njit_cached
def unpack_source(words: Any) -> Any:
    """Return the ``RaySource`` of the words of a packed one."""
    leaves = _leaves_of(words)
    return RaySource(RayColumns(*leaves[:6]), NodeTable(*leaves[6:10]), leaves[10])
