"""Which points have nothing opaque near them."""

from typing import Any

import numpy as np

from radarsim.jit import njit_cached, njit_inline
from radarsim.raycast.intersect import is_opaque_nearby, new_query_buffer
from radarsim.raycast.robot_boxes import is_box_near
from radarsim.raycast.traced_scene import unpack_scene


@njit_inline
def _is_clear(
    scene: Any, medium: Any, point: Any, radius: Any, carrier_id: Any, work: Any
) -> Any:
    if is_box_near(scene.boxes, carrier_id, point, radius):
        return False
    roles = scene.materials.forward_roles[medium]
    return not is_opaque_nearby(scene.handle, roles, point, radius, work)


@njit_cached
def find_clear(
    words: Any, boxes: Any, medium: Any, points: Any, radius: Any, carrier_ids: Any
) -> Any:
    """Return which points are certainly clear, (N,) bool.

    Args:
        words: The words of the ``PackedScene``, with materials for each medium.
        boxes: (B, 10) the boxes of the robots, from ``Boxes.table``.
        medium: ``RADAR`` or ``LASER``.
        points: (N, 3 or more) m, map frame; only the first three columns count.
        radius: m.
        carrier_ids: (N,) id of the box that does not count for each point; -1 for none.
    """
    scene = unpack_scene(words, boxes, boxes[:0, 0])
    work, point = new_query_buffer(), np.zeros(3)
    clear = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        for axis in range(3):
            point[axis] = points[i, axis] - scene.centre[axis]
        reach = radius + scene.handle.margin
        clear[i] = _is_clear(scene, medium, point, reach, carrier_ids[i], work)
    return clear
