"""Take scans, one or many at once.

Theory of operation
===================
Random numbers are drawn scan by scan, so that each generator is used as if the scans
were taken one after the other. Everything else is done for all scans of equal sensors
in a few calls of the engine, on all processors where there are many rays or poses.

Rays are aimed in the call that traces them. Only where something opaque is so near a
sensor that side rays may start behind it, its rays are aimed first: from there it
cannot see, and the centre ray takes the place of those rays.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose3
from radarsim.processes import thread_count
from radarsim.raycast.aimed_rays import AimedRays, Nodes, Sides
from radarsim.raycast.attenuation import Outcome
from radarsim.raycast.rays import Rays, Traces
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer
from radarsim.scene.scene import Scene
from radarsim.sensors.measurement import Draws, PlannedScan
from radarsim.sensors.scan import Scan

if TYPE_CHECKING:
    from radarsim.sensors.range_scanner import RangeScanner

CHUNK_RAYS: Final = 20_000  # traced in one piece, in some 10 ms
MIDDLE_NODE: Final = 1  # of three


class ScanRequest(NamedTuple):
    """A scan to be taken.

    Attributes:
        scanner: The sensor.
        pose: Pose of the sensor, map frame.
        rng: Source of randomness; None for a sensor that needs none.
        carrier_id: Id of the box that carries the sensor; -1 for none.
    """

    scanner: "RangeScanner"
    pose: Pose3
    rng: np.random.Generator | None = None
    carrier_id: int = -1


class ScanGroup(NamedTuple):
    """Scans of equal sensors, which are traced in one call.

    Attributes:
        scanner: One of the sensors.
        indices: The number of each scan among all that were requested.
        requests: The scans.
        draws: The random numbers of each.
    """

    scanner: "RangeScanner"
    indices: list[int]
    requests: list[ScanRequest]
    draws: list[Draws]

    def take(self, rows: Sequence[int]) -> "ScanGroup":
        """Return some of the scans."""
        return ScanGroup(
            self.scanner,
            [self.indices[row] for row in rows],
            [self.requests[row] for row in rows],
            [self.draws[row] for row in rows],
        )

    def range_errors(self) -> Floats:
        """Return the errors of all ranges, scan by scan; empty without noise."""
        return np.concatenate([draws.range_error for draws in self.draws])

    def places(self) -> Floats:
        """Return the sensors' places, (J, 7), as in ``UnaimedScans``."""
        rows = [(*each.pose.numbers(), each.carrier_id) for each in self.requests]
        return np.array(rows, np.float64)


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


def draw_scans(tracer: Tracer, requests: Sequence[ScanRequest]) -> list[ScanGroup]:
    """Draw the random numbers of scans.

    Which ones are drawn depends on the scene only in whether it rains there and whether
    it has clouds, so that moving robots do not change the numbers drawn next.

    Args:
        tracer: Tracer of the scene.
        requests: The scans.

    Raises:
        ValueError: If an rng is needed and missing.
    """
    groups: dict[object, ScanGroup] = {}
    for i, request in enumerate(requests):
        scanner = request.scanner
        draws = scanner.draw(
            request.rng, is_raining=tracer.has_rain, has_clouds=tracer.has_clouds
        )
        # Rays that are random are no nodes, which scans could share.
        # Settings that are equal share their pattern, so that the pattern itself tells
        # which scanners are traced together.
        key = i if scanner.pattern.has_random_rays else scanner.pattern
        group = groups.get(key)
        if group is None:
            groups[key] = ScanGroup(scanner, [i], [request], [draws])
        else:
            group.indices.append(i)
            group.requests.append(request)
            group.draws.append(draws)
    return list(groups.values())


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
    return _trace_groups(tracer, draw_scans(tracer, requests), boxes, scene)


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
            continue
        taken = _trace_group(tracer, group, boxes, None)
        for i, scan in zip(group.indices, taken, strict=True):
            scans[i], ranges[i] = scan, np.minimum(scan.ranges, most)
    return BatchRanges([ranges[i] for i in range(len(requests))], scans)


def _trace_groups(
    tracer: Tracer,
    groups: Sequence[ScanGroup],
    boxes: Boxes | None,
    scene: Scene | None,
) -> list[Scan]:
    """Trace the rays of scans; return them in the order of the requests."""
    if len(groups) == 1:  # without ordering, which would take 1 us (row d)
        return _trace_group(tracer, groups[0], boxes, scene)
    scans: dict[int, Scan] = {}
    for group in groups:
        taken = _trace_group(tracer, group, boxes, scene)
        scans.update(zip(group.indices, taken, strict=True))
    return [scans[i] for i in range(len(scans))]


def _trace_group(
    tracer: Tracer, group: ScanGroup, boxes: Boxes | None, scene: Scene | None
) -> list[Scan]:
    """Take scans of equal sensors."""
    pattern, places = group.scanner.pattern, group.places()
    events, incidence = group.draws[0].events, group.scanner.builder.needs_incidence
    unaimed = pattern.unaimed([draws.beams for draws in group.draws], places)
    traced = tracer.trace_scans(unaimed, boxes, events=events, incidence=incidence)
    size, scans = pattern.rays_per_scan, []
    pieces = _split_scans(traced.traces, group)
    for k, (request, draws, piece) in enumerate(
        zip(group.requests, group.draws, pieces, strict=True)
    ):
        own = slice(k * size, (k + 1) * size)
        is_random = pattern.has_random_rays
        sides = pattern.sides_of(draws.beams) if is_random else traced.sides[own]
        find_rays = partial(_aim_again, request, draws, traced.nodes[own])
        plan = PlannedScan(tracer, request.pose, sides, find_rays, draws)
        scans.append(request.scanner.builder.build(plan, piece, scene))
    # Seldom: only scanners within centimetres of something opaque are aimed first.
    if traced.crowded:
        crowded = np.flatnonzero(~traced.clear).tolist()
        some = group.take(crowded)
        plans = aim_scans_apart(tracer, some, boxes)
        rays = Rays.concatenate([plan.rays for plan in plans])
        traces = tracer.trace(rays, boxes, events=events, incidence=incidence)
        pieces = _split_scans(traces, some)
        for k, plan, piece in zip(crowded, plans, pieces, strict=True):
            builder = group.requests[k].scanner.builder
            scans[k] = builder.build(plan, piece, scene)
    return scans


def _split_scans(traces: Traces, group: ScanGroup) -> list[Traces]:
    """Return the traces of each scan of a group."""
    count = len(group.requests)
    if count == 1:  # parts of all columns would take 1 us (row d of the benchmarks)
        return [traces]
    return traces.split([group.scanner.pattern.rays_per_scan] * count)


def _aim_again(request: ScanRequest, draws: Draws, nodes: Nodes) -> Rays:
    """Aim the rays of a scan that was traced.

    Args:
        request: The scan.
        draws: The random numbers that were drawn for it.
        nodes: (M,) node of its beam that each ray was.
    """
    pattern = request.scanner.pattern
    pose = np.array([request.pose.numbers()], np.float64)
    if pattern.has_random_rays:
        aimed = pattern.aim(pose, [draws.beams])
    else:
        aimed = pattern.aim_nodes(pose, nodes)
    return pattern.rays_from(aimed, request.carrier_id)


def _trace_ranges(tracer: Tracer, group: ScanGroup, boxes: Boxes | None) -> Floats:
    """Return the ranges, (J, N), of scans of equal sensors that read ends of rays."""
    pattern, builder = group.scanner.pattern, group.scanner.builder
    unaimed = pattern.unaimed([draws.beams for draws in group.draws], group.places())
    traced = tracer.trace_scans(unaimed, boxes)
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


def aim_scans_apart(
    tracer: Tracer, group: ScanGroup, boxes: Boxes | None = None
) -> list[PlannedScan]:
    """Aim the rays of scans before they are traced.

    Side rays that start behind an opaque surface are replaced by the centre ray.

    Args:
        tracer: Tracer of the scene.
        group: The scans.
        boxes: Boxes of the robots.

    Returns:
        The scans; their rays are rows of the same ``Rays``, scan by scan.
    """
    pattern, places = group.scanner.pattern, group.places()
    poses, size = places[:, :6].copy(), pattern.rays_per_scan
    carrier_ids = np.repeat(places[:, 6].astype(np.int64), size)
    aimed = pattern.aim(poses, [draws.beams for draws in group.draws])
    if pattern.radius:
        medium = group.scanner.medium
        hidden = _are_hidden(tracer, boxes, medium, poses, carrier_ids, aimed)
        nodes = np.where(hidden, MIDDLE_NODE, aimed.nodes).astype(np.int16)
        aimed = pattern.aim_nodes(poses, nodes)
    rays = pattern.rays_from(aimed, carrier_ids)
    plans = []
    for k, (request, draws) in enumerate(zip(group.requests, group.draws, strict=True)):
        start, end = k * size, (k + 1) * size
        find_rays = partial(rays.rows, start, end)
        sides = aimed.sides[start:end]
        plans.append(PlannedScan(tracer, request.pose, sides, find_rays, draws))
    return plans


def _are_hidden(
    tracer: Tracer,
    boxes: Boxes | None,
    medium: int,
    poses: Floats,
    carrier_ids: NDArray[np.int64],
    aimed: AimedRays,
) -> NDArray[np.bool_]:
    """Return which rays start behind an opaque surface, seen from their sensor.

    Args:
        tracer: Tracer of the scene.
        boxes: Boxes of the robots.
        medium: ``RADAR`` or ``LASER``.
        poses: (J, 6) of the sensors, map frame.
        carrier_ids: (J * M,) the box that carries the sensor of each ray.
        aimed: The rays.
    """
    starts = aimed.origins
    positions = np.repeat(poses[:, :3], len(starts) // len(poses), axis=0)
    offset = starts - positions
    length = np.linalg.norm(offset, axis=1)
    moved = np.flatnonzero(length > 0)
    to_starts = replace(
        Rays.uniform(
            positions[moved],
            offset[moved] / length[moved, None],
            max_range=0.0,
            medium=medium,
        ),
        max_range=length[moved],
        carrier_id=carrier_ids[moved],
    )
    traces = tracer.trace(to_starts, boxes)
    hidden = np.zeros(len(starts), np.bool_)
    hidden[moved] = traces.outcomes != Outcome.NOTHING
    return hidden


def scan_poses(
    scanner: "RangeScanner",
    tracer: Tracer,
    poses: Sequence[Pose3],
    rng: np.random.Generator | None,
) -> ScanArrays:
    """Scan from each pose, in order.

    Args:
        scanner: The sensor.
        tracer: Tracer of the scene.
        poses: Poses of the sensor, map frame.
        rng: Source of random rays and noise.

    Raises:
        ValueError: If an rng is needed and missing.
    """
    return stack_scans(scanner, poses, _scans(scanner, tracer, poses, rng))


def stack_scans(
    scanner: "RangeScanner", poses: Sequence[Pose3], scans: Iterable[Scan]
) -> ScanArrays:
    """Return the readings of scans of one sensor, from each of the poses, as arrays."""
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
) -> Iterator[Scan]:
    """Yield the scan of each pose; chunks are traced ahead of those that are read."""
    step = max(CHUNK_RAYS // scanner.pattern.rays_per_scan, 1)
    pending: deque[Future[list[Scan]]] = deque()
    workers = thread_count()
    with ThreadPoolExecutor(workers) as pool:
        for start in range(0, len(poses), step):
            requests = [
                ScanRequest(scanner, pose, rng) for pose in poses[start : start + step]
            ]
            # Drawn here and traced there: threads must not share a generator.
            groups = draw_scans(tracer, requests)
            pending.append(pool.submit(_trace_groups, tracer, groups, None, None))
            # At most one chunk waits for each thread, so that memory does not grow with
            # the poses.
            if len(pending) > workers:
                yield from pending.popleft().result()
        for future in pending:
            yield from future.result()
