"""Many scans at once: of many sensors, or of one sensor from many poses.

Rays are drawn scan by scan, so that the values are those of as many single scans in the
same order. Tracing needs neither random numbers nor Python's lock: for many poses, rays
are traced in threads, a chunk of scans at a time, while those of the next are drawn.
"""

from collections import defaultdict, deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from radarsim.cpu_count import process_cpu_count
from radarsim.geometry import Floats, Pose3
from radarsim.raycast.rays import Rays
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer
from radarsim.sensors.beams import Sides
from radarsim.sensors.measurement import PlannedScan
from radarsim.sensors.scan import Scan

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
    planned: Sequence[tuple["RangeScanner", PlannedScan]],
    boxes: Boxes | None = None,
) -> list[Scan]:
    """Trace planned scans together and build them.

    Scans that need events or incidence are traced apart from the others, for which
    recording these would cost time.

    Args:
        tracer: Tracer of the scene for which the scans are planned.
        planned: Each scanner with its plan.
        boxes: Boxes of the robots.

    Returns:
        The scans in the same order.
    """
    groups: defaultdict[tuple[bool, bool], list[int]] = defaultdict(list)
    for i, (_, plan) in enumerate(planned):
        groups[plan.events, plan.incidence].append(i)
    scans: dict[int, Scan] = {}
    for (events, incidence), members in groups.items():
        batches = [planned[i][1].rays for i in members]
        traces = tracer.trace(
            Rays.concatenate(batches), boxes, events=events, incidence=incidence
        )
        pieces = traces.split([len(rays.max_range) for rays in batches])
        for i, piece in zip(members, pieces, strict=True):
            scanner, plan = planned[i]
            scans[i] = scanner.read(plan, piece)
    return [scans[i] for i in range(len(planned))]


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
            chunk = poses[start : start + step]
            planned = [(scanner, scanner.plan(tracer, pose, rng)) for pose in chunk]
            pending.append(pool.submit(scan_batch, tracer, planned))
            if len(pending) > workers:
                yield from pending.popleft().result()
        for future in pending:
            yield from future.result()
