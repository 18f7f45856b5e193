"""Computes one scan or many scans at once.

Theory of operation
===================
Random numbers are drawn scan by scan, in the same order as for scans computed one after
the other. All other steps process all scans of equal sensors in a few calls of the
engine, on all processors if there are many rays or poses.

If a sensor reads only the ends of its rays, the ranges come directly from the traces. A
sensor that keeps other echoes, or combines many rays per beam, needs the events along
the rays. With incidence weights, one ray of each beam is drawn after all rays are
traced: its probability is proportional to its weight times the backscatter at its end.
A ray that hit nothing has the probability 0, unless all rays of the beam hit nothing.

Range errors are added last: a beam has one error, which shifts all its echoes, so the
echoes keep their order. Then ranges are rounded to multiples of the range quantum.
"""

import math
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cached_property, partial
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose3
from radarsim.processes import thread_count
from radarsim.raycast.rays import Boxes, EventKind, Outcome, Rays, Sides
from radarsim.raycast.tracer import Tracer
from radarsim.scene.scene import Scene
from radarsim.sensors.beams import EXPONENTIAL, BeamPattern
from radarsim.sensors.echo_extraction import (
    EchoTable,
    backscatter,
    extract_echoes,
    extract_ray_ends,
    merge_echoes,
    select_echoes,
)
from radarsim.sensors.rain_and_clouds import add_rain, answer_in_clouds, find_rain
from radarsim.sensors.scan import Echoes, Scan

if TYPE_CHECKING:
    from radarsim.sensors.range_scanner import RangeScanner

CHUNK_RAYS: Final = 20_000  # rays per task of a thread; a task takes about 10 ms
ALL_NODES: Final = np.zeros((1, 0))  # no random numbers: all nodes are traced
ECHO_FIELDS: Final = {
    "beams": "beam", "ranges": "t", "fronts": "front", "kinds": "kind",
    "power": "power", "strength": "strength", "parts": "part",
}  # fmt: skip
Rows = NDArray[np.int64]


class ScanRequest(NamedTuple):
    """A request for one scan.

    Attributes:
        scanner: The sensor.
        pose: Pose of the sensor, map frame.
        rng: Random generator; None for a sensor that needs none.
        carrier_id: Id of the box that carries the sensor; -1 for none.
    """

    scanner: "RangeScanner"
    pose: Pose3
    rng: np.random.Generator | None = None
    carrier_id: int = -1


class ScanArrays(NamedTuple):
    """The ranges of M scans of a sensor with N beams.

    Attributes:
        poses: (M, 6) x, y, z, m, and roll, pitch, yaw, rad, of the sensor, map frame.
        angles: (N,) azimuths of the beams from the sensor's forward axis, rad,
            counter-clockwise.
        ranges: (M, N) m; inf where nothing was detected, 0 where a laser is blinded.
        rays: (M, N) ray of the beam that gave each range: -1 right, 0 centre, 1 left;
            None for a sensor without side rays.
    """

    poses: Floats
    angles: Floats
    ranges: Floats
    rays: Sides | None


class ScanBatch:
    """J scans of sensors with equal settings, which are traced together.

    ``draw`` must be called for each scan before ``trace``.

    Attributes:
        pattern: The beams and rays of the sensors.
        kinds: The kinds of random numbers of the pattern, plus those for rain and
            clouds in the scene.
        needs_events: Whether the events along the rays are traced.
        drawn: The random numbers of each kind, J rows.
        ranges: (J, N) m, as in ``ScanArrays``.
        rays: (J, N), or None, as in ``ScanArrays``.
        nodes: (J, M) index of each ray's node in its beam.
    """

    ranges: Floats
    rays: Sides | None

    def __init__(self, pattern: BeamPattern, tracer: Tracer, places: Floats) -> None:
        """Allocate the arrays for the random numbers of all scans.

        How many numbers are drawn depends only on the sensor and on whether the scene
        has rain or clouds, so moving robots do not change later random numbers.

        Args:
            pattern: The beams; with random rays, the batch can have only one scan.
            tracer: Tracer of the scene.
            places: (J, 7) poses and carriers of the sensors, see
                ``Tracer.trace_scans``.
        """
        self.pattern, self._tracer, self._places = pattern, tracer, places
        self.kinds, self.needs_events = pattern.kinds, pattern.needs_events
        settings, beams = pattern.settings, len(pattern.angles)
        if tracer.has_rain and settings.medium == "radar":
            self.kinds = [*self.kinds, ("rain", EXPONENTIAL, (2, beams))]
            self.needs_events = True
        if tracer.has_clouds and settings.reads_first_returns:
            self.kinds = [*self.kinds, ("cloud", EXPONENTIAL, (beams,))]
        count = len(places)
        self.drawn = {kind: np.zeros((count, *shape)) for kind, _, shape in self.kinds}
        self._echoes: EchoTable | None = None  # echoes of all beams, computed on demand
        self._rows: Rows | None = None  # selected ray of each beam; None if it has one

    def draw(
        self, row: int | slice, rng: np.random.Generator | None, sensor: str
    ) -> None:
        """Draw the random numbers that a scan needs.

        Args:
            row: Number of the scan; or a slice of all scans if there is only one kind.
            rng: Random generator.
            sensor: Name of the sensor, for an error message.

        Raises:
            ValueError: If an rng is needed and missing.
        """
        has_rng = isinstance(rng, np.random.Generator)
        if self.kinds and not has_rng:
            raise ValueError(f"no rng, expected a Generator for sensor {sensor!r}")
        for kind, method, _ in self.kinds:
            method(rng, out=self.drawn[kind][row])

    def trace(self, boxes: Boxes | None = None, threads: int | None = None) -> None:
        """Trace the rays of all scans, and read their ranges.

        Args:
            boxes: Boxes of the robots.
            threads: As in ``Tracer.trace_scans``.
        """
        pattern, random = self.pattern, self._random_rays(0)
        size = len(self._places) * len(pattern.shares)
        nodes, sides = np.zeros(size, np.int16), np.zeros(size, np.int8)
        chances = self.drawn.get("nodes", ALL_NODES)
        self._traces = self._tracer.trace_scans(
            pattern.source(random),
            pattern.ray_classes,
            (self._places, chances, nodes, sides),
            boxes,
            events=self.needs_events,
            incidence=pattern.settings.incidence_weights,
            threads=threads,
        )
        self.nodes = nodes.reshape(len(self._places), -1)
        self._sides = sides if random is None else pattern.sides_of(random)
        if pattern.selects_ray:
            self._rows = self._select_rays()
        ranges = self._read_echoes() if self.needs_events else self._read_ends()
        self.ranges = ranges.reshape(len(self._places), -1)
        self.rays = None
        if pattern.settings.has_side_rays:
            read = self._sides if self._rows is None else self._sides[self._rows]
            self.rays = read.reshape(self.ranges.shape)

    def scan(
        self, row: int, sensor: str, pose: Pose3, scene: Scene | None = None
    ) -> Scan:
        """Return a scan of the batch.

        Args:
            row: Number of the scan.
            sensor: Name of the sensor.
            pose: Pose of the sensor.
            scene: The scene that the scan refers to for plots; None without one.
        """
        settings = self.pattern.settings
        # Positional arguments are used, since they are faster than keyword arguments.
        return Scan(
            sensor,
            pose,
            self.pattern.angles,
            self.ranges[row],
            None if self.rays is None else self.rays[row],
            settings.min_range,
            settings.max_range,
            math.radians(settings.resolution_deg),
            partial(self._cast, row),
            partial(self._echoes_of, row),
            scene,
        )

    @cached_property
    def reported(self) -> Floats:
        """The ranges that robots report, (J, N) m; the maximum range if no return."""
        return np.minimum(self.ranges, self.pattern.settings.max_range)

    def all_rays(self, row: int) -> Rays:
        """Return all M rays that were traced for a scan."""
        *numbers, carrier = self._places[row].tolist()
        drawn = self._random_rays(row)
        return self.pattern.aim(Pose3(*numbers), int(carrier), self.nodes[row], drawn)

    def _random_rays(self, row: int) -> Floats | None:
        return self.drawn["rays"][row] if self.pattern.has_random_rays else None

    def _cast(self, row: int) -> Rays:
        """Return the N rays that gave the ranges of a scan."""
        rays = self.all_rays(row)
        if self._rows is None:
            return rays
        rows = self._rows.reshape(self.ranges.shape)[row]
        return rays.take(rows - row * len(self.pattern.shares))

    def _select_rays(self) -> Rows:
        """Select one ray of each beam at random; return the rays' indices, (J * N,)."""
        per_beam = self.pattern.rays
        weights = self._all_shares().reshape(-1, per_beam)
        chances = weights * backscatter(self._traces).reshape(-1, per_beam)
        empty = ~(chances.sum(axis=1) > 0)  # no ray of the beam hit anything
        chances[empty] = weights[empty]
        # Each beam uses one random number drawn before tracing, so later random numbers
        # do not depend on the objects that rays hit.
        edges = np.cumsum(chances, axis=1)
        drawn = self.drawn["selected"].ravel() * edges[:, -1]
        node = (edges[:, :-1] <= drawn[:, None]).sum(axis=1)
        return np.asarray(np.arange(len(node)) * per_beam + node)

    def _all_shares(self) -> Floats:
        shares, count = self.pattern.shares, len(self._places)
        return shares if count == 1 else np.tile(shares, count)

    def _read_ends(self) -> Floats:
        """Return the ranges, (J * N,) m, at which the rays of the beams end."""
        traces, rows, settings = self._traces, self._rows, self.pattern.settings
        # Errors are added to a copy, since echoes need the exact ranges later.
        ranges = traces.ranges.copy() if rows is None else traces.ranges[rows]
        self._add_errors(ranges, self.drawn.get("errors"))
        if settings.spent_reads != "range":
            spent = traces.outcomes == Outcome.SPENT
            reading = 0.0 if settings.spent_reads == "zero" else math.inf
            ranges[spent if rows is None else spent[rows]] = reading
        return ranges

    def _read_echoes(self) -> Floats:
        """Return the ranges, (J * N,) m, of the echoes selected for the beams."""
        pattern, settings = self.pattern, self.pattern.settings
        per_beam = pattern.rays
        # Without a selected ray, the middle ray represents a beam.
        middle = np.arange(per_beam // 2, self.nodes.size, per_beam)
        rows = middle if self._rows is None else self._rows
        echoes = self._all_echoes(rows)
        ranges, rays = np.full(len(rows), np.inf), rows.copy()
        kept = select_echoes(echoes, settings, ranges, rays)
        if settings.spent_reads == "zero":
            spent = self._traces.outcomes[rays] == Outcome.SPENT
            ranges[np.isfinite(ranges) & spent] = 0.0
        self._echoes = echoes if settings.return_mode == "all" else echoes.take(kept)
        self._rows = rays
        return ranges

    def _all_echoes(self, rows: Rows) -> EchoTable:
        """Return the echoes of all scans, including rain, with range errors.

        Args:
            rows: (J * N,) index of the ray that represents each beam.
        """
        pattern, tracer, traces = self.pattern, self._tracer, self._traces
        settings, ray_class = pattern.settings, pattern.ray_classes[0]
        shares = self._all_shares()
        if pattern.selects_ray:
            shares = np.zeros(self.nodes.size)
            shares[rows] = 1.0
        losses = tracer.losses(ray_class)
        echoes = extract_echoes(traces, shares, pattern.rays, losses, settings)
        if "rain" in self.drawn:
            random = np.concatenate(self.drawn["rain"], axis=1)
            rain = find_rain(tracer, traces.events, rows, random, settings)
            echoes = add_rain(echoes, rain)
        if "cloud" in self.drawn:
            clouds = np.where(tracer.clouds, losses[0], 0.0)
            depths = self.drawn["cloud"]
            echoes = answer_in_clouds(echoes, traces.events, clouds, depths, settings)
        echoes = merge_echoes(echoes, settings.range_resolution)
        self._move_echoes(echoes)
        return echoes

    def _end_echoes(self) -> EchoTable:
        """Return only the echoes at the ends of rays, with range errors."""
        settings, rows = self.pattern.settings, self._rows
        rows = np.arange(self.nodes.size) if rows is None else rows
        echoes = extract_ray_ends(self._traces, rows, settings)
        if settings.spent_reads == "nothing":
            echoes = echoes.take(np.flatnonzero(echoes["kind"] != EventKind.SPENT))
        self._move_echoes(echoes)
        return echoes

    def _move_echoes(self, echoes: EchoTable) -> None:
        """Add the random range error of each beam to its echoes, in place."""
        errors = self.drawn.get("errors")
        if errors is not None:
            errors = errors.ravel()[echoes["beam"]]
        self._add_errors(echoes["t"], errors)
        self._add_errors(echoes["front"], errors)

    def _add_errors(self, ranges: Floats, errors: Floats | None) -> None:
        """Add the sensor's random errors to ranges, in place, and quantise the ranges.

        Args:
            ranges: Ranges, m.
            errors: Errors in standard deviations; None for a sensor without noise.
        """
        settings = self.pattern.settings
        if errors is None and not settings.range_quantum:
            return
        # A beam without a return has an infinite range, which stays unchanged.
        finite = np.isfinite(ranges)
        if errors is not None:
            exact = ranges[finite]
            share = settings.range_noise_share * exact
            deviation = np.maximum(settings.range_noise, share)
            moved = exact + errors.ravel()[finite] * deviation
            ranges[finite] = np.clip(moved, 0.0, settings.max_range)
        if settings.range_quantum:
            # The largest multiple of the quantum within the maximum range; the factor 1
            # + 1e-12 compensates the rounding of the quotient.
            last = math.floor(settings.max_range / settings.range_quantum * (1 + 1e-12))
            steps = np.rint(ranges[finite] / settings.range_quantum)
            ranges[finite] = np.minimum(steps, last) * settings.range_quantum

    def _echoes_of(self, row: int) -> Echoes:
        """Return the echoes of a scan."""
        if self._echoes is None:
            self._echoes = self._end_echoes()
        beams = len(self.pattern.angles)
        ends = np.searchsorted(self._echoes["beam"], [row * beams, (row + 1) * beams])
        table = self._echoes[slice(*ends.tolist())].copy()
        table["beam"] -= row * beams
        columns = {
            name: np.ascontiguousarray(table[field])
            for name, field in ECHO_FIELDS.items()
        }
        return Echoes(
            **columns,
            sides=self._sides[table["row"]],
            scene_parts=self._tracer.parts,
            settings=self.pattern.settings,
        )


def take_scans(
    tracer: Tracer, requests: Sequence[ScanRequest], boxes: Boxes | None = None
) -> list[tuple[ScanBatch, int]]:
    """Compute the requested scans; scans with equal settings are traced together.

    Args:
        tracer: Tracer of the scene.
        requests: The requested scans.
        boxes: Boxes of the robots.

    Returns:
        The batch of each scan, and the scan's row in it. The scans are the same as if
        they were computed one after the other.

    Raises:
        ValueError: If an rng is needed and missing.
    """
    groups: dict[object, list[int]] = {}
    for i, request in enumerate(requests):
        # Sensors with equal settings share a pattern and can be traced in one batch.
        # Random rays differ between scans, so each scan with random rays has its own
        # batch.
        pattern = request.scanner.pattern
        key = i if pattern.has_random_rays else pattern
        groups.setdefault(key, []).append(i)
    taken: dict[int, tuple[ScanBatch, int]] = {}
    for numbers in groups.values():
        some = [requests[i] for i in numbers]
        places = [(*each.pose.numbers(), each.carrier_id) for each in some]
        table = np.array(places, np.float64)
        batch = ScanBatch(some[0].scanner.pattern, tracer, table)
        taken |= {i: (batch, row) for row, i in enumerate(numbers)}
    in_order = [taken[i] for i in range(len(requests))]
    for request, (batch, row) in zip(requests, in_order, strict=True):
        batch.draw(row, request.rng, request.scanner.name)
    for batch in dict.fromkeys(batch for batch, _ in in_order):
        batch.trace(boxes)
    return in_order


def scan_poses(
    scanner: "RangeScanner",
    tracer: Tracer,
    poses: Floats,
    rng: np.random.Generator | None,
) -> ScanArrays:
    """Compute a scan from each of M poses, on all processors.

    Args:
        scanner: The sensor.
        tracer: Tracer of the scene.
        poses: (M, 6) poses of the sensor, map frame.
        rng: Generator of random rays and noise.

    Raises:
        ValueError: If an rng is needed and missing.
    """
    pattern, beams, workers = scanner.pattern, len(scanner.angles), thread_count()
    ranges = np.zeros((len(poses), beams))
    rays = np.zeros((len(poses), beams), np.int8)
    places = np.full((len(poses), 7), -1.0)
    places[:, :6] = poses
    step = max(CHUNK_RAYS // len(pattern.shares), 1)
    step = 1 if pattern.has_random_rays else step

    def take(start: int, batch: ScanBatch) -> None:
        batch.trace(threads=1)
        ranges[start : start + step] = batch.ranges
        if batch.rays is not None:
            rays[start : start + step] = batch.rays

    pending: deque[Future[None]] = deque()
    with ThreadPoolExecutor(workers) as pool:
        for start in range(0, len(poses), step):
            batch = ScanBatch(pattern, tracer, places[start : start + step])
            # Random numbers are drawn in this thread, since threads must not share a
            # generator.
            whole = [slice(None)] if len(batch.kinds) == 1 else None
            for row in whole or range(len(places[start : start + step])):
                batch.draw(row, rng, scanner.name)
            pending.append(pool.submit(take, start, batch))
            # At most one batch per thread waits, so memory does not grow with the
            # number of poses.
            if len(pending) > workers:
                pending.popleft().result()
        for future in pending:
            future.result()
    sides = rays if scanner.has_side_rays else None
    return ScanArrays(poses, scanner.angles, ranges, sides)
