"""Many scans at once: of many sensors, or of one sensor from many poses.

Random numbers are drawn scan by scan, so that the values are those of as many single
scans in the same order. Then the rays of all scans of equal sensors are aimed and
traced in one compiled call. That needs neither random numbers nor Python's lock: for
many poses, scans are traced in threads, a chunk at a time, while the next are drawn.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from radarsim.geometry import Floats, Pose3
from radarsim.processes import process_cpu_count
from radarsim.raycast.aimed_rays import Nodes, Sides
from radarsim.raycast.rays import Rays, Traces
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import TracedScans, Tracer
from radarsim.scene.scene import Scene
from radarsim.sensors.measurement import PlannedScan
from radarsim.sensors.scan import Scan
from radarsim.sensors.scan_plan import (
    ScanGroup,
    ScanRequest,
    aim_scans_apart,
    draw_scans,
)

if TYPE_CHECKING:
    from radarsim.sensors.range_scanner import RangeScanner

CHUNK_RAYS: Final = 20_000  # traced in one piece, in some 10 ms


class ScanArrays(NamedTuple):
    """M scans of a sensor with N beams.

    Attributes:
        poses: (M, 6) x, y, z, m, and roll, pitch, yaw, rad, of the sensor, map frame.
        angles: (N,) directions of the beams from the sensor's forward axis, rad,
            counter-clockwise.
        ranges: (M, N) m; inf where nothing was detected, 0 where a laser is blinded.
        rays: (M, N) ray of its beam that gave each range: -1 right, 0 centre, 1 left;
            None for a sensor without side rays.
    """

    poses: Floats
    angles: Floats
    ranges: Floats
    rays: Sides | None


class BatchRanges(NamedTuple):
    """What many scans read.

    Attributes:
        ranges: Of each scan (N,) m; beams without return have the maximum range.
        scans: Scans for which events were traced, by number.
    """

    ranges: list[Floats]
    scans: dict[int, Scan]


def scan_batch(
    tracer: Tracer,
    requests: Sequence[ScanRequest],
    boxes: Boxes | None = None,
    *,
    scene: Scene | None = None,
) -> list[Scan]:
    """Take many scans at once.

    Args:
        tracer: Tracer of the scene.
        requests: The scans.
        boxes: Boxes of the robots.
        scene: The scene, if the scans shall know it.

    Returns:
        The scans in the same order; each is that which its sensor would take alone, if
        all were taken one after the other.

    Raises:
        ValueError: If an rng is needed and missing.
    """
    return trace_groups(tracer, draw_scans(tracer, requests), boxes, scene=scene)


def trace_groups(
    tracer: Tracer,
    groups: Sequence[ScanGroup],
    boxes: Boxes | None = None,
    *,
    scene: Scene | None = None,
) -> list[Scan]:
    """Aim and trace the rays of scans, and build the scans.

    Args:
        tracer: Tracer of the scene.
        groups: What ``draw_scans`` returned.
        boxes: Boxes of the robots.
        scene: The scene, if the scans shall know it.

    Returns:
        The scans in the order in which they were requested.
    """
    if len(groups) == 1:
        return _trace_group(tracer, groups[0], boxes, scene)
    scans: dict[int, Scan] = {}
    for group in groups:
        taken = _trace_group(tracer, group, boxes, scene)
        scans.update(zip(group.indices, taken, strict=True))
    return [scans[i] for i in range(len(scans))]


def scan_ranges(
    tracer: Tracer, requests: Sequence[ScanRequest], boxes: Boxes | None = None
) -> BatchRanges:
    """Take many scans of which little else is asked for than the ranges.

    Where only the ends of rays are read, no ``Scan`` is built.

    Args:
        tracer: Tracer of the scene.
        requests: The scans.
        boxes: Boxes of the robots.

    Returns:
        The ranges that ``scan_batch`` would give.

    Raises:
        ValueError: If an rng is needed and missing.
    """
    ranges: dict[int, Floats] = {}
    scans: dict[int, Scan] = {}
    for group in draw_scans(tracer, requests):
        most = group.scanner.settings.max_range
        if group.scanner.builder.reads_ends and not group.draws[0].events:
            rows = _trace_ranges(tracer, group, boxes)
            ranges.update(zip(group.indices, np.minimum(rows, most), strict=True))
        else:
            taken = _trace_group(tracer, group, boxes, None)
            scans.update(zip(group.indices, taken, strict=True))
            for i, scan in zip(group.indices, taken, strict=True):
                ranges[i] = np.minimum(scan.ranges, most)
    return BatchRanges([ranges[i] for i in range(len(requests))], scans)


def _trace_ranges(tracer: Tracer, group: ScanGroup, boxes: Boxes | None) -> Floats:
    """Return the ranges, (J, N), of scans of equal sensors that read ends of rays."""
    scanner, builder = group.scanner, group.scanner.builder
    traced = tracer.trace_scans(scanner.unaimed(group), boxes)
    readings = traced.traces.ranges
    builder.read_ends(readings, traced.traces.outcomes, group.range_errors())
    ranges = readings.reshape(len(group.indices), -1)
    if traced.crowded:
        crowded = np.flatnonzero(~traced.clear)
        some = group.take(crowded.tolist())
        plans = aim_scans_apart(tracer, some, boxes)
        traces = tracer.trace(Rays.concatenate([plan.rays for plan in plans]), boxes)
        builder.read_ends(traces.ranges, traces.outcomes, some.range_errors())
        ranges[crowded] = traces.ranges.reshape(len(crowded), -1)
    return ranges


def _trace_group(
    tracer: Tracer, group: ScanGroup, boxes: Boxes | None, scene: Scene | None
) -> list[Scan]:
    """Take scans of equal sensors."""
    scanner = group.scanner
    events, incidence = group.draws[0].events, scanner.needs_incidence
    traced = tracer.trace_scans(
        scanner.unaimed(group), boxes, events=events, incidence=incidence
    )
    scans = _build_traced(tracer, group, traced, scene)
    if traced.crowded:
        crowded = np.flatnonzero(~traced.clear).tolist()
        plans = aim_scans_apart(tracer, group.take(crowded), boxes)
        rays = Rays.concatenate([plan.rays for plan in plans])
        traces = tracer.trace(rays, boxes, events=events, incidence=incidence)
        pieces = _split(traces, len(plans), events=events)
        for k, plan, (piece, first) in zip(crowded, plans, pieces, strict=True):
            builder = group.requests[k].scanner.builder
            scans[k] = builder.build(plan, piece, first, scene)
    return scans


def _build_traced(
    tracer: Tracer, group: ScanGroup, traced: TracedScans, scene: Scene | None
) -> list[Scan]:
    """Build scans whose rays were aimed while they were traced.

    Those that are not clear have to be replaced.
    """
    pattern, incidence = group.scanner.pattern, group.scanner.needs_incidence
    pieces = _split_scans(traced, len(group.draws), events=group.draws[0].events)
    scans = []
    for request, draws, (traces, first, nodes, drawn) in zip(
        group.requests, group.draws, pieces, strict=True
    ):
        scanner = request.scanner
        sides = pattern.sides_of(draws.beams) if pattern.has_random_rays else drawn
        aim = partial(scanner.aim_again, request, draws, nodes)
        plan = PlannedScan(tracer, request.pose, sides, aim, draws, incidence)
        scans.append(scanner.builder.build(plan, traces, first, scene))
    return scans


def _split_scans(
    traced: TracedScans, count: int, *, events: bool
) -> list[tuple[Traces, int, Nodes, Sides]]:
    """Return the traces of each scan, which of them is its first, nodes and sides."""
    nodes, sides = traced.nodes, traced.sides
    if count == 1:
        return [(traced.traces, 0, nodes, sides)]
    size = len(nodes) // count
    pieces = _split(traced.traces, count, events=events)
    return [
        (*piece, nodes[start : start + size], sides[start : start + size])
        for piece, start in zip(pieces, range(0, len(nodes), size), strict=True)
    ]


def _split(traces: Traces, count: int, *, events: bool) -> list[tuple[Traces, int]]:
    """Return for each of some scans the traces, and which of them is its first."""
    if count == 1:
        return [(traces, 0)]
    size = len(traces.ranges) // count
    if events:
        return [(piece, 0) for piece in traces.split([size] * count)]
    return [(traces, k * size) for k in range(count)]


def scan_poses(
    scanner: "RangeScanner",
    tracer: Tracer,
    poses: Sequence[Pose3],
    rng: np.random.Generator | None,
    *,
    workers: int | None = None,
) -> ScanArrays:
    """Scan from each pose, in order.

    Args:
        scanner: The sensor.
        tracer: Tracer of the scene.
        poses: Poses of the sensor, map frame.
        rng: Source of random rays and noise.
        workers: Number of threads that trace; None for all processors.

    Raises:
        ValueError: If an rng is needed and missing.
    """
    scans = _scans(scanner, tracer, poses, rng, workers or process_cpu_count())
    return _stack(scanner, poses, scans)


def stack_scans(scanner: "RangeScanner", scans: Sequence[Scan]) -> ScanArrays:
    """Return the readings of scans of one sensor as arrays."""
    return _stack(scanner, [scan.pose for scan in scans], scans)


def _stack(
    scanner: "RangeScanner", poses: Sequence[Pose3], scans: Iterable[Scan]
) -> ScanArrays:
    beams = len(scanner.angles)
    ranges = np.zeros((len(poses), beams))
    rays = np.zeros((len(poses), beams), np.int8)
    for row, scan in enumerate(scans):
        ranges[row] = scan.ranges
        if scan.rays is not None:
            rays[row] = scan.rays
    table = np.array([pose.numbers() for pose in poses], np.float64).reshape(-1, 6)
    sides = rays if scanner.has_side_rays else None
    return ScanArrays(table, scanner.angles, ranges, sides)


def _scans(
    scanner: "RangeScanner",
    tracer: Tracer,
    poses: Sequence[Pose3],
    rng: np.random.Generator | None,
    workers: int,
) -> Iterator[Scan]:
    """Yield the scan of each pose; chunks are traced ahead of those that are read."""
    step = max(CHUNK_RAYS // scanner.rays_per_scan, 1)
    pending: deque[Future[list[Scan]]] = deque()
    with ThreadPoolExecutor(workers) as pool:
        for start in range(0, len(poses), step):
            requests = [
                ScanRequest(scanner, pose, rng) for pose in poses[start : start + step]
            ]
            groups = draw_scans(tracer, requests)
            pending.append(pool.submit(trace_groups, tracer, groups))
            if len(pending) > workers:
                yield from pending.popleft().result()
        for future in pending:
            yield from future.result()
