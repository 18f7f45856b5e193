"""The kernel that traces all rays of a call, one after the other.

Rays are given one by one, or as scans: then each is aimed right before it is traced, so
that one call does all there is to a scan but the drawing of random numbers. There is
one kernel for both, because most of its code is the tracing, which takes half a minute
to compile (row f of the benchmarks).
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import Int, njit_cached, njit_inline
from radarsim.raycast.aimed_rays import (
    Frame,
    Nodes,
    RaySource,
    Sides,
    aim_ray,
    fill_frame,
    node_of,
    unpack_source,
)
from radarsim.raycast.attenuation import Events, new_ray_state
from radarsim.raycast.crossings import CROSSING
from radarsim.raycast.intersect import (
    QueryBuffer,
    is_opaque_nearby,
    new_query_buffer,
    new_ray_buffer,
)
from radarsim.raycast.propagate import (
    NearVolumes,
    TraceColumns,
    Workspace,
    trace_ray,
)
from radarsim.raycast.robot_boxes import BoxGrid, is_box_near, new_box_grid
from radarsim.raycast.traced_scene import TracedScene, Words, unpack_scene

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


@njit_inline
def _is_clear(
    scene: TracedScene,
    grid: BoxGrid,
    point: Floats,
    radius: float,
    carrier_id: Int,
    query: QueryBuffer,
) -> bool:
    """Return whether there is certainly nothing opaque around a point.

    Args:
        scene: The scene.
        grid: The boxes' grid.
        point: (3,) m, relative to the scene's centre.
        radius: m.
        carrier_id: Id of the box that does not count; -1 for none.
        query: From ``new_query_buffer``.

    Returns:
        False also where something is only a little farther away.
    """
    reach = radius + scene.handle.margin
    if is_box_near(grid, scene.boxes, carrier_id, point, reach):
        return False
    roles = scene.materials.forward_roles[CLEARANCE_CLASS]
    return not is_opaque_nearby(scene.handle, roles, point, reach, query)


@njit_inline
def _trace_all(
    source: RaySource,
    scans: ScanColumns,
    frame: Frame,
    query: QueryBuffer,
    scene: TracedScene,
    work: Workspace,
    traces: TraceColumns,
) -> tuple[Int, int]:
    """Trace all rays; return the first two results of ``trace_rays``.

    The loop is here and not there, where it would count references to the arrays (row a
    of the benchmarks).
    """
    rays, table, radius = source
    origin, direction, count = work.origin, work.direction, len(traces.ranges)
    are_scans = len(scans.places) > 0
    rays_per_scan = count // max(len(scans.places), 1)
    rays_per_beam = rays_per_scan // max(table.directions.shape[1], 1)
    i: Int = 0
    first: Int = 0
    end: Int = 0
    scan, crowded = -1, 0
    while i < count:
        if i == end and are_scans:
            first, scan, end = end, scan + 1, end + rays_per_scan
            fill_frame(scans.places, scan, frame)
            for axis in range(3):
                origin[axis] = frame.position[axis] - scene.centre[axis]
            own_id = scans.places[scan, CARRIER]
            is_traced = radius == 0.0 or _is_clear(
                scene, work.box_grid, origin, radius, own_id, query
            )
            scans.clear[scan] = is_traced
            if not is_traced:
                i, crowded = end, crowded + 1
                continue
        row: Int = i
        if are_scans:
            row, carrier_id = 0, int(scans.places[scan, CARRIER])
            beam, node = i - first, 0
            if rays_per_beam > 1:  # else there is nothing to divide
                beam, node = beam // rays_per_beam, beam % rays_per_beam
            if scans.chances.size:
                node = node_of(table.edges, scans.chances[scan, beam])
            scans.nodes[i] = node
            scans.ray_sides[i] = table.sides[node]
            aim_ray(table, frame, beam, node, origin, direction)
        else:
            carrier_id = rays.carrier_id[i]
            for axis in range(3):
                origin[axis] = rays.origins[i, axis]
                direction[axis] = rays.directions[i, axis]
        max_range, power = rays.max_range[row], rays.power[row]
        ray_class = rays.class_index[row]
        code = trace_ray(
            i, max_range, power, ray_class, carrier_id, scene, work, traces
        )
        if code:
            return code, crowded
        i += 1
    return 0, crowded


@njit_cached
def trace_rays(
    scene_words: Words,
    source_words: Words,
    boxes: Floats,
    max_crossings: int,
    events: Events,
    *columns: NDArray[Any],
) -> tuple[int, int, float, float]:
    """Trace rays one after the other.

    Args:
        scene_words: The words of the packed scene.
        source_words: The words of the packed ``RaySource``; of the single row of scans
            the carrier is not read.
        boxes: (B, 10) the boxes of the robots, from ``Boxes.table``.
        max_crossings: How many crossings of one segment there is room for.
        events: As in ``RayState``.
        columns: The ``TraceColumns`` to be filled, and the ``ScanColumns``; one by one,
            because numba takes twice as long to unpack tuples of arrays (row d).

    Returns:
        0; or the number of surfaces on a segment that has more than there is room for;
        or, for an invalid ray, -1 minus its index. How many scans are not clear. The
        height, m, of the last level ray that found no slice, and how many did not.
    """
    traces, scans = TraceColumns(*columns[:5]), ScanColumns(*columns[5:])
    scene, source = unpack_scene(scene_words, boxes), unpack_source(source_words)
    crossings = np.zeros(max_crossings, CROSSING)
    state = new_ray_state(scene.materials.density.shape[1], crossings, events)
    buffer = new_ray_buffer(scene.handle, crossings)
    grid = new_box_grid(boxes, len(traces.ranges))
    volumes = np.zeros(scene.materials.volume.size, np.int64)
    near_volumes = NearVolumes(np.full(3, np.inf), np.zeros(1, np.int64), volumes)
    work = Workspace(buffer, state, np.zeros(3), np.zeros(3), grid, near_volumes)
    frame = Frame(np.zeros(3), np.zeros((3, 3)))
    code, crowded = _trace_all(
        source, scans, frame, new_query_buffer(), scene, work, traces
    )
    return int(code), crowded, scene.unsliced[0], scene.unsliced[1]
