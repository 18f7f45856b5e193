"""Build scans from traced rays: select echoes, add range errors, quantise.

Theory of operation
===================
A sensor that reads only where its rays end takes that from the traces directly. One
that keeps other echoes, or combines many rays per beam, needs the events along them.
With incidence weights, one ray of each beam is drawn after all of them are traced: its
probability is its weight times the backscatter at its end, and a ray that met nothing
has none, unless no ray of the beam met anything.

The range errors of a sensor come last: a beam has one error, which moves all its
echoes, so that they keep their order; then ranges are rounded to whole steps.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose3
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.raycast.aimed_rays import Sides
from radarsim.raycast.attenuation import EventKind, Outcome
from radarsim.raycast.rays import Rays, Traces
from radarsim.raycast.tracer import Tracer
from radarsim.scene.scene import Scene
from radarsim.sensors.beams import BeamPattern, ray_class_of
from radarsim.sensors.echo_extraction import (
    EchoTable,
    backscatter,
    extract_echoes,
    extract_ray_ends,
    merge_echoes,
    select_echoes,
)
from radarsim.sensors.echo_strength import Densities
from radarsim.sensors.first_returns import answer_in_clouds
from radarsim.sensors.rain import add_rain, find_rain
from radarsim.sensors.scan import Echoes, Scan

Rows = NDArray[np.int64]


class Draws(NamedTuple):
    """The random numbers of one scan; empty columns where it needs none.

    Attributes:
        beams: What ``BeamPattern.draw`` returned.
        ray: (N,) 0 to 1, which select one ray of each beam after tracing.
        range_error: (N,) errors of the ranges, in standard deviations.
        rain: (2, N), which decide where rain shows, and how strongly.
        cloud: (N,), which decide how deep in smoke each beam answers.
        events: Whether tracing must record the events along the rays.
    """

    beams: Floats
    ray: Floats
    range_error: Floats
    rain: Floats
    cloud: Floats
    events: bool


class PlannedScan(NamedTuple):
    """A scan whose rays are chosen.

    Attributes:
        tracer: Tracer of the scene.
        pose: Pose of the sensor, map frame.
        sides: (M,) side of its beam on which each ray is.
        find_rays: Computes ``rays`` on demand.
        draws: The random numbers that are used after tracing.
    """

    tracer: Tracer
    pose: Pose3
    sides: Sides
    find_rays: Callable[[], Rays]
    draws: Draws

    @property
    def rays(self) -> Rays:
        """The M rays."""
        return self.find_rays()


class ScanBuilder:
    """Builds the scans of one scanner.

    Attributes:
        selects_ray: Whether one ray of each beam is selected after all are traced.
        needs_incidence: Whether it needs the angles of incidence.
        needs_events: Whether it needs the events along the rays.
        reads_ends: Whether a beam has one ray, of which only the end is read.
        is_noisy: Whether ranges have random errors.
        is_random: Whether it needs random numbers for either.
        reads_first_returns: As in its settings.
    """

    def __init__(
        self, name: str, settings: SensorSettings, pattern: BeamPattern
    ) -> None:
        self._name = name
        self._settings = settings
        self._pattern = pattern
        self._ray_class = ray_class_of(settings)
        many_rays = pattern.rays > 1
        self.selects_ray = many_rays and not settings.combines_rays
        self.needs_incidence = settings.incidence_weights
        self.needs_events = (
            settings.return_mode != "last"
            or settings.range_resolution > 0
            or (many_rays and not self.selects_ray)
        )
        self.reads_ends = not (self.needs_events or self.selects_ray)
        self.is_noisy = settings.range_noise > 0 or settings.range_noise_share > 0
        self.is_random = self.selects_ray or self.is_noisy
        self.reads_first_returns = settings.reads_first_returns
        self._has_errors = self.is_noisy or settings.range_quantum > 0
        self._has_side_rays = settings.has_side_rays
        # what a beam reads where its ray was spent; None for where that was
        self._spent_range = {"zero": 0.0, "nothing": math.inf, "range": None}[
            settings.spent_reads
        ]
        self._resolution = math.radians(settings.resolution_deg)
        self._shares = np.tile(pattern.weights, len(pattern.angles))
        # the ray of each beam that represents it where none was selected
        self._middle_rows = np.arange(len(pattern.angles)) * pattern.rays + (
            pattern.rays // 2
        )

    def build(
        self, plan: PlannedScan, traces: Traces, scene: Scene | None = None
    ) -> Scan:
        """Build a scan from its traced rays.

        Args:
            plan: A scan planned by this scanner.
            traces: Its traced rays, with events if its draws say so, and with incidence
                if that is needed.
            scene: The scene, if no robots are in it.
        """
        rows = self._select_rays(plan, traces) if self.selects_ray else None
        if plan.draws.events:
            return self._build_from_events(plan, traces, rows, scene)
        if rows is None:
            outcomes, ranges = traces.outcomes, traces.ranges.copy()
        else:
            outcomes, ranges = traces.outcomes[rows], traces.ranges[rows]
        # Changed in place; the echoes, which few ask for, follow from exact ranges.
        self.read_ends(ranges, outcomes, plan.draws.range_error)
        find_echoes = partial(self._end_echoes, plan, traces, rows)
        return self._scan(plan, ranges, rows, find_echoes, scene)

    def read_ends(
        self, ranges: Floats, outcomes: NDArray[np.uint8], error: Floats
    ) -> None:
        """Turn the ends of rays into readings of the sensor, in place.

        Args:
            ranges: (M,) m, distances of the ends; the readings afterwards.
            outcomes: (M,) how each ray ended.
            error: (M,) errors in standard deviations; empty for a sensor without noise.
        """
        self._add_errors(ranges, error)
        if self._spent_range is not None:
            ranges[outcomes == Outcome.SPENT] = self._spent_range

    def _select_rays(self, plan: PlannedScan, traces: Traces) -> Rows:
        """Select one ray of each beam at random; return their indices, (N,)."""
        per_beam = self._pattern.rays
        weights = self._shares.reshape(-1, per_beam)
        chances = weights * backscatter(traces).reshape(-1, per_beam)
        empty = ~(chances.sum(axis=1) > 0)  # no ray of the beam met anything
        chances[empty] = weights[empty]
        # One draw for each beam, made before tracing: the numbers that follow must not
        # depend on what the rays met.
        edges = np.cumsum(chances, axis=1)
        drawn = plan.draws.ray * edges[:, -1]
        node = (edges[:, :-1] <= drawn[:, None]).sum(axis=1)
        return np.asarray(np.arange(len(node)) * per_beam + node)

    def _build_from_events(
        self,
        plan: PlannedScan,
        traces: Traces,
        rows: Rows | None,
        scene: Scene | None,
    ) -> Scan:
        settings = self._settings
        echoes = self._all_echoes(plan, traces, rows)
        ranges = np.full(len(self._pattern.angles), np.inf)
        rays = (self._middle_rows if rows is None else rows).copy()
        kept = select_echoes(echoes, settings, ranges, rays)
        if settings.spent_reads == "zero":
            spent = traces.outcomes[rays] == Outcome.SPENT
            ranges[np.isfinite(ranges) & spent] = 0.0
        if settings.return_mode != "all":
            echoes = echoes.take(kept)
        find_echoes = partial(self._echoes, plan, echoes)
        return self._scan(plan, ranges, rays, find_echoes, scene)

    def _all_echoes(
        self, plan: PlannedScan, traces: Traces, rows: Rows | None
    ) -> EchoTable:
        """Return all echoes, rain included, merged and with range errors."""
        settings = self._settings
        weights = self._shares if self._pattern.rays > 1 else np.ones(len(plan.sides))
        if rows is not None:
            weights = np.zeros(len(plan.sides))
            weights[rows] = 1.0
        densities = Densities(
            *plan.tracer.densities(self._ray_class),
            plan.tracer.scattering(self._ray_class),
        )
        echoes = extract_echoes(
            traces, weights, self._pattern.rays, densities, settings
        )
        if plan.draws.rain.size:
            stand_ins = self._middle_rows if rows is None else rows
            rain = find_rain(
                plan.tracer, traces.events, stand_ins, plan.draws.rain, settings
            )
            echoes = add_rain(echoes, rain)
        if plan.draws.cloud.size:
            echoes = answer_in_clouds(
                echoes,
                traces.events,
                np.where(plan.tracer.clouds, densities.parts, 0.0),
                plan.draws.cloud,
                settings,
            )
        echoes = merge_echoes(echoes, settings.range_resolution)
        self._move_echoes(echoes, plan.draws.range_error)
        return echoes

    def _move_echoes(self, echoes: EchoTable, errors: Floats) -> None:
        """Add the random errors of beams, (N,), to their echoes, in place."""
        error = errors[echoes["beam"]] if self.is_noisy else None
        self._add_errors(echoes["t"], error)
        self._add_errors(echoes["front"], error)

    def _add_errors(self, ranges: Floats, error: Floats | None) -> None:
        """Add the sensor's random errors to ranges and quantise them, in place."""
        if not self._has_errors:
            return
        settings = self._settings
        # A beam that met nothing has no range that could be wrong.
        finite = np.isfinite(ranges)
        if error is not None and error.size:
            exact = ranges[finite]
            deviation = np.maximum(
                settings.range_noise, settings.range_noise_share * exact
            )
            moved = exact + error[finite] * deviation
            ranges[finite] = np.clip(moved, 0.0, settings.max_range)
        if settings.range_quantum:
            # the last whole step within range; 1e-12 absorbs rounding of the quotient
            last = math.floor(settings.max_range / settings.range_quantum * (1 + 1e-12))
            steps = np.rint(ranges[finite] / settings.range_quantum)
            ranges[finite] = np.minimum(steps, last) * settings.range_quantum

    def _scan(
        self,
        plan: PlannedScan,
        ranges: Floats,
        rows: Rows | None,
        find_echoes: Callable[[], Echoes],
        scene: Scene | None,
    ) -> Scan:
        sides, settings = None, self._settings
        if self._has_side_rays:
            sides = plan.sides if rows is None else plan.sides[rows]
        # in the order of its attributes: names would take longer
        return Scan(
            self._name,
            plan.pose,
            self._pattern.angles,
            ranges,
            sides,
            settings.min_range,
            settings.max_range,
            self._resolution,
            partial(_cast, plan, rows),
            find_echoes,
            scene,
        )

    def _echoes(self, plan: PlannedScan, echoes: EchoTable) -> Echoes:
        def column(name: str) -> NDArray[Any]:
            return np.ascontiguousarray(echoes[name])

        return Echoes(
            beams=column("beam"),
            sides=plan.sides[echoes["row"]],
            ranges=column("t"),
            fronts=column("front"),
            kinds=column("kind"),
            power=column("power"),
            strength=column("strength"),
            parts=column("part"),
            scene_parts=plan.tracer.parts,
            settings=self._settings,
        )

    def _end_echoes(
        self, plan: PlannedScan, traces: Traces, rows: Rows | None
    ) -> Echoes:
        """Return the echoes at the ends of the rays, for which no events are needed."""
        rows = np.arange(len(self._pattern.angles)) if rows is None else rows
        echoes = extract_ray_ends(traces, rows, self._settings)
        if self._settings.spent_reads == "nothing":
            echoes = echoes.take(np.flatnonzero(echoes["kind"] != EventKind.SPENT))
        self._move_echoes(echoes, plan.draws.range_error)
        return self._echoes(plan, echoes)


def _cast(plan: PlannedScan, rows: Rows | None) -> Rays:
    """Return the rays in some rows of a plan; None for all of them."""
    return plan.rays if rows is None else plan.rays.take(rows)
