"""The kernel that traces all rays of a call, one after the other.

Rays are given one by one, or as scans: then each is aimed right before it is traced, so
that one call does all there is to a scan but the drawing of random numbers. There is
one kernel for both, because most of its code is the tracing, which is compiled once.

Whether nothing opaque is near a point.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
from radarsim.raycast.aimed_rays import (
    Frame,
    Nodes,
    NodeTable,
    Sides,
    aim_ray,
    fill_frame,
    node_of,
    unpack_source,
)
from radarsim.raycast.attenuation import new_ray_state
from radarsim.raycast.crossings import CROSSING
from radarsim.raycast.intersect import (
    is_opaque_nearby,
    new_query_buffer,
    new_ray_buffer,
)
from radarsim.raycast.propagate import RayLimits, TraceColumns, Workspace, trace_ray
from radarsim.raycast.robot_boxes import (
    index_boxes,
    index_boxes_around,
    is_box_near,
    new_box_index,
)
from radarsim.raycast.traced_scene import unpack_scene


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


CLEARANCE_CLASS: Final = 1  # index of the class for which something may hide a ray
CARRIER: Final = 6  # column of ``UnaimedScans.places``


class ScanColumns(NamedTuple):
    """J scans of M rays each as the kernel takes them; all empty for given rays.

    Attributes:
        chances: (J, N) or (1, 0), as in ``UnaimedScans``.
        places: (J, 7), likewise.
        nodes: (J * M,) to be filled: the node of its beam that each ray is.
        ray_sides: (J * M,) to be filled: the side of its beam on which each ray is.
        clear: (J,) bool, to be filled: which scans were traced. The others have
            something opaque near their sensor, behind which a ray may start.
    """

    chances: Floats
    places: Floats
    nodes: Nodes
    ray_sides: Sides
    clear: NDArray[np.bool_]


NO_SCANS: Final = ScanColumns(
    np.zeros((1, 0)),
    np.zeros((0, 7)),
    np.zeros(0, np.int16),
    np.zeros(0, np.int8),
    np.zeros(0, np.bool_),
)


class Aim(NamedTuple):
    """The scans of a call, and how their rays are aimed.

    Attributes:
        scans: The scans.
        table: The nodes of all beams.
        radius: As in ``RaySource``.
        rays_per_scan: M.
        rays_per_beam: Number of rays of each beam.
        frame: The frame of the sensor whose rays come next.
        query: From ``new_query_buffer``.
    """

    scans: ScanColumns
    table: NodeTable
    radius: float
    rays_per_scan: int
    rays_per_beam: int
    frame: Frame
    query: Any


@njit_inline
def _start_scan(scan: Any, aim: Any, scene: Any, work: Any) -> Any:
    """Prepare for the rays of a scan; return whether it has to be traced."""
    scans, radius, origin = aim.scans, aim.radius, work.origin
    fill_frame(scans.places, scan, aim.frame)
    for axis in range(3):
        origin[axis] = aim.frame.position[axis] - scene.centre[axis]
    index_boxes(
        *(work.box_index, scene.boxes),
        *(origin[0], origin[1], radius, aim.rays_per_scan),
    )
    carrier_id = scans.places[scan, CARRIER]
    is_traced = radius == 0.0 or is_clear(
        scene, CLEARANCE_CLASS, origin, radius, carrier_id, aim.query
    )
    scans.clear[scan] = is_traced
    return is_traced


@njit_inline
def _aim_next(i: Any, scan: Any, k: Any, aim: Any, work: Any) -> None:
    """Set the workspace to ray ``k`` of a scan, the ``i``-th of all."""
    scans, table = aim.scans, aim.table
    beam, node = k, 0
    if aim.rays_per_beam > 1:  # else there is nothing to divide
        beam, node = k // aim.rays_per_beam, k % aim.rays_per_beam
    if scans.chances.size:
        node = node_of(table.edges, scans.chances[scan, beam])
    scans.nodes[i] = node
    scans.ray_sides[i] = table.sides[node]
    aim_ray(table, aim.frame, beam, node, work.origin, work.direction)


@njit_inline
def _take_given(i: Any, rays: Any, work: Any) -> None:
    """Set the workspace to a given ray."""
    for axis in range(3):
        work.origin[axis] = rays.origins[i, axis]
        work.direction[axis] = rays.directions[i, axis]


@njit_inline
def _trace_all(aim: Any, scene: Any, rays: Any, work: Any, traces: Any) -> Any:
    """Trace all rays; return the first two results of ``trace_rays``.

    The loop is here and not there, where it would count references to the arrays.
    """
    scans, count = aim.scans, len(traces.ranges)
    are_scans = len(scans.places) > 0
    i: Any = 0
    first, end, scan, crowded = 0, 0, -1, 0
    while i < count:
        if i == end and are_scans:
            first, scan, end = end, scan + 1, end + aim.rays_per_scan
            if not _start_scan(scan, aim, scene, work):
                i, crowded = end, crowded + 1
                continue
        elif i == end:
            end = index_boxes_around(work.box_index, scene, rays, i)
        row: Any = i
        if are_scans:
            row, carrier_id = 0, int(scans.places[scan, CARRIER])
            _aim_next(i, scan, i - first, aim, work)
        else:
            carrier_id = rays.carrier_id[i]
            _take_given(i, rays, work)
        limits = RayLimits(
            i, rays.max_range[row], rays.power[row], rays.class_index[row], carrier_id
        )
        code = trace_ray(limits, scene, work, traces)
        if code:
            return code, crowded
        i += 1
    return 0, crowded


@njit_cached
def trace_rays(
    scene_words: Any,
    source_words: Any,
    boxes: Any,
    max_crossings: Any,
    events: Any,
    *columns: Any,
) -> Any:
    """Trace rays one after the other.

    Columns come one by one: numba takes twice as long to unpack tuples of arrays.

    Args:
        scene_words: The words of the ``PackedScene``.
        source_words: The words of the packed ``RaySource``; of the single row of scans
            the carrier is not read.
        boxes: (B, 10) the boxes of the robots, from ``Boxes.table``.
        max_crossings: How many crossings of one segment there is room for.
        events: As in ``RayState``.
        columns: The ``TraceColumns`` to be filled, and the ``ScanColumns``.

    Returns:
        0; or the number of surfaces on a segment that has more than there is room for;
        or, for an invalid ray, -1 minus its index. How many scans are not clear. The
        height, m, of the last level ray that found no slice, and how many did not.
    """
    traces, scans = TraceColumns(*columns[:5]), ScanColumns(*columns[5:])
    scene = unpack_scene(scene_words, boxes)
    rays, table, radius = unpack_source(source_words)
    crossings = np.zeros(max_crossings, CROSSING)
    state = new_ray_state(scene.materials.density.shape[1], crossings, events)
    buffer = new_ray_buffer(scene.handle, crossings)
    index = new_box_index(len(boxes))
    work = Workspace(buffer, state, np.zeros(3), np.zeros(3), index)
    per_scan = len(traces.ranges) // max(len(scans.places), 1)
    per_beam = per_scan // max(table.directions.shape[1], 1)
    frame = Frame(np.zeros(3), np.zeros((3, 3)))
    aim = Aim(scans, table, radius, per_scan, per_beam, frame, new_query_buffer())
    code, crowded = _trace_all(aim, scene, rays, work, traces)
    return code, crowded, scene.unsliced[0], scene.unsliced[1]
