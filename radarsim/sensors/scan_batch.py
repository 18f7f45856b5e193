"""Many scans at once: of many sensors, or of one sensor from many poses.

Rays are drawn scan by scan, so that the values are those of as many single scans in the
same order. Tracing needs neither random numbers nor Python's lock: for many poses, rays
are traced in threads, a chunk of scans at a time, while those of the next are drawn.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import accumulate
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from radarsim.cpu_count import process_cpu_count
from radarsim.geometry import Floats, Pose3
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer
from radarsim.scene.scene import Scene
from radarsim.sensors.beams import Sides
from radarsim.sensors.scan import Scan
from radarsim.sensors.scan_plan import ScanGroup, ScanRequest, plan_scans

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
    groups = plan_scans(tracer, requests, boxes)
    return trace_groups(tracer, requests, groups, boxes, scene=scene)


def trace_groups(
    tracer: Tracer,
    requests: Sequence[ScanRequest],
    groups: Sequence[ScanGroup],
    boxes: Boxes | None = None,
    *,
    scene: Scene | None = None,
) -> list[Scan]:
    """Trace planned scans, and build them.

    Args:
        tracer: Tracer of the scene.
        requests: The scans.
        groups: What ``plan_scans`` returned for them.
        boxes: Boxes of the robots.
        scene: The scene, if the scans shall know it.

    Returns:
        The scans in the order of the requests.
    """
    scans: dict[int, Scan] = {}
    for group in groups:
        traces = tracer.trace(
            group.rays, boxes, events=group.events, incidence=group.incidence
        )
        sizes = [len(plan.sides) for plan in group.plans]
        if group.events:
            pieces = traces.split(sizes)
            for i, plan, piece in zip(group.indices, group.plans, pieces, strict=True):
                scans[i] = requests[i].scanner.builder.build(plan, piece, scene)
        else:
            starts = accumulate(sizes, initial=0)
            for i, plan, first in zip(group.indices, group.plans, starts, strict=False):
                builder = requests[i].scanner.builder
                scans[i] = builder.build_from_ends(plan, traces, first, scene)
    return [scans[i] for i in range(len(requests))]


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
    beams = len(scanner.angles)
    ranges = np.zeros((len(poses), beams))
    rays = np.zeros((len(poses), beams), np.int8)
    scans = _scans(scanner, tracer, poses, rng, workers or process_cpu_count())
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
            groups = plan_scans(tracer, requests)
            pending.append(pool.submit(trace_groups, tracer, requests, groups))
            if len(pending) > workers:
                yield from pending.popleft().result()
        for future in pending:
            yield from future.result()
