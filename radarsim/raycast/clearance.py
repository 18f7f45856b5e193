"""Whether nothing opaque is near a point."""

from typing import Any

from radarsim.jit import njit_inline
from radarsim.raycast.intersect import is_opaque_nearby
from radarsim.raycast.robot_boxes import is_box_near


@njit_inline
def is_clear(
    scene: Any, ray_class: Any, point: Any, radius: Any, carrier_id: Any, query: Any
) -> Any:
    """Return whether there is certainly nothing opaque around a point.

    Args:
        scene: The ``TracedScene``.
        ray_class: The index of the class for which something is opaque.
        point: (3,) m, relative to the scene's centre.
        radius: m.
        carrier_id: Id of the box that does not count; -1 for none.
        query: From ``new_query_buffer``.

    Returns:
        False also where something is only a little farther away.
    """
    reach = radius + scene.handle.margin
    if is_box_near(scene.boxes, carrier_id, point, reach):
        return False
    roles = scene.materials.forward_roles[ray_class]
    return not is_opaque_nearby(scene.handle, roles, point, reach, query)
