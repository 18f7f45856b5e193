"""What depends on the triangle that a ray ends at: incidence, and how it goes on.

A mirror reflects a ray, unless the ray meets it so nearly head-on that it comes
straight back: then the mirror ends it like any other surface, and answers. The surface
of a pane is a mirror that passes a part. A ray has one way on, and takes the stronger.

Arguments named ``scene``, ``ray`` and ``work`` are those of ``propagate``.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from radarsim.jit import njit_inline
from radarsim.raycast.attenuation import END_HIT, T_START, SegmentEnd
from radarsim.raycast.intersect import opaque_triangle
from radarsim.raycast.robot_boxes import box_incidence

MIRROR_OFFSET: Final = 1e-9  # m; the next segment starts this far before a mirror
ENDS, REFLECTED, PASSED = 0, 1, 2  # how a ray goes on from an opaque surface


class WayOn(NamedTuple):
    """How a ray goes on from an opaque surface.

    Attributes:
        way: ``ENDS``, ``REFLECTED`` or ``PASSED``.
        cost: Power that the surface takes.
        is_bounce: Whether it is one of those of which a ray has a limited number.
    """

    way: int
    cost: float
    is_bounce: bool


@njit_inline
def _opaque_normal(scene: Any, work: Any) -> Any:
    """Return the unit normal of the triangle at which the last segment ended."""
    triangles, k = scene.triangles, opaque_triangle(scene.handle, work.buffer)
    ax, ay = triangles[k, 3] - triangles[k, 0], triangles[k, 4] - triangles[k, 1]
    bx, by = triangles[k, 6] - triangles[k, 0], triangles[k, 7] - triangles[k, 1]
    az, bz = triangles[k, 5] - triangles[k, 2], triangles[k, 8] - triangles[k, 2]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    return nx / length, ny / length, nz / length


@njit_inline
def find_way_on(ray: Any, part: Any, scene: Any, work: Any) -> Any:
    """Return the ``WayOn`` from the opaque surface of a part that ended a segment."""
    materials, direction, ray_class = scene.materials, work.direction, ray.ray_class
    absorbed = materials.absorption[ray_class, part]
    if not materials.mirror[ray_class, part]:
        return WayOn(ENDS, absorbed, False)
    passing = materials.passing[ray_class, part]
    nx, ny, nz = _opaque_normal(scene, work)
    along = nx * direction[0] + ny * direction[1] + nz * direction[2]
    if along > 0.0 and passing < np.inf:  # a ray inside a pane leaves it
        return WayOn(PASSED, passing, False)
    if ray.reflections <= 0 or abs(along) >= materials.glint[ray_class]:
        return WayOn(ENDS, absorbed, False)
    if passing <= absorbed:  # each half of the loss on either way
        return WayOn(PASSED, passing, True)
    # A reflected wave passes the mirror out and back.
    return WayOn(REFLECTED, 2.0 * absorbed, True)


@njit_inline
def end_before_mirror(ray: Any, end: Any, scene: Any, work: Any) -> Any:
    """Drop the crossings that coincide with a mirror at the end of a segment.

    The next segment starts a little before the mirror, and would cross them again.
    """
    mirror = scene.materials.mirror[ray.ray_class]
    part, count = end.part, end.crossed
    if ray.reflections <= 0 or part < 0 or part >= mirror.size or not mirror[part]:
        return end
    nx, ny, nz = _opaque_normal(scene, work)
    direction, crossings = work.direction, work.state.crossings
    along = abs(nx * direction[0] + ny * direction[1] + nz * direction[2])
    # Along a slanted ray the offset from the mirror's plane is longer.
    near = end.t - MIRROR_OFFSET / max(along, MIRROR_OFFSET)
    while count > 0 and crossings[count - 1].t >= near:
        count -= 1
    return SegmentEnd(count, end.t, part)


@njit_inline
def go_on(way: Any, scene: Any, t: Any, work: Any) -> None:
    """Set origin and direction of the segment that follows the last one.

    Args:
        way: ``REFLECTED`` or ``PASSED``.
        scene: The ``TracedScene``.
        t: Length of the last segment, m.
        work: The workspace.
    """
    origin, direction = work.origin, work.direction
    if way == PASSED:
        for axis in range(3):
            origin[axis] += (t + MIRROR_OFFSET) * direction[axis]
        return
    nx, ny, nz = _opaque_normal(scene, work)
    along = nx * direction[0] + ny * direction[1] + nz * direction[2]
    if along > 0.0:  # the back of the triangle is hit
        nx, ny, nz, along = -nx, -ny, -nz, -along
    origin[0] += t * direction[0] + MIRROR_OFFSET * nx
    origin[1] += t * direction[1] + MIRROR_OFFSET * ny
    origin[2] += t * direction[2] + MIRROR_OFFSET * nz
    direction[0] -= 2.0 * along * nx
    direction[1] -= 2.0 * along * ny
    direction[2] -= 2.0 * along * nz


@njit_inline
def incidence_of(end: Any, scene: Any, work: Any) -> Any:
    """Return the cosine between a ray and the normal of the surface that it hit.

    Args:
        end: The ``RayEnd``; NaN is returned if it is no hit.
        scene: The ``TracedScene``.
        work: The workspace, as the last segment left it.
    """
    if end.outcome != END_HIT:
        return np.nan
    direction, parts = work.direction, work.state.winding.size
    if end.part >= parts:
        t = end.t - work.state.segment[T_START]
        return box_incidence(scene.boxes, end.part - parts, work.origin, direction, t)
    nx, ny, nz = _opaque_normal(scene, work)
    along = nx * direction[0] + ny * direction[1] + nz * direction[2]
    return min(abs(along), 1.0)
