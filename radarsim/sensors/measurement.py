"""What rays met, made into the readings of a sensor.

Theory of operation
===================
A sensor that reads where its rays end takes that from the traces as it is. One that
keeps other echoes, or has many rays to a beam, needs to know all that happened to them.
With incidence weights, one ray of each beam is chosen here, after all of them are cast:
its chance is its weight times what its end sends back, and a ray that met nothing has
none, unless none of them met anything.

The errors of a sensor come last: a beam has one error, by which all its echoes move,
so that they keep their order; then ranges are rounded to whole steps.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose3
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.raycast.attenuation import Outcome
from radarsim.raycast.rays import Rays, Traces
from radarsim.raycast.tracer import Tracer
from radarsim.sensors.beams import BeamPattern, Sides
from radarsim.sensors.echo_extraction import (
    SPENT,
    EchoColumns,
    backscatter,
    extract_echoes,
    ray_ends,
)
from radarsim.sensors.echo_selection import FIRST, LAST, STRONGEST, choose, merge
from radarsim.sensors.echoes import Echoes
from radarsim.sensors.rain import speckle, with_rain
from radarsim.sensors.scan import Scan

MODES: Final = {"last": LAST, "all": LAST, "first": FIRST, "strongest": STRONGEST}
Rows = NDArray[np.int64]


class PlannedScan(NamedTuple):
    """A scan that waits to be cast.

    Attributes:
        tracer: Of the scene.
        pose: Of the sensor, map frame.
        sides: (M,) on which side of its beam each ray is.
        rays: M of them, as many for each beam.
        chance: (N,) 0 to 1, what chooses a ray once all are cast; empty if nothing
            is to be chosen.
        error: (N,) of the ranges, in standard deviations; empty for none.
        rain: (2, N) what decides where rain shows, and how much of it; empty where
            none falls.
        events: Whether all that happens to the rays is to be written down.
        incidence: Whether the angles at which they hit are.
    """

    tracer: Tracer
    pose: Pose3
    sides: Sides
    rays: Rays
    chance: Floats
    error: Floats
    rain: Floats
    events: bool
    incidence: bool


class ScanBuilder:
    """Makes scans of traces.

    Attributes:
        chooses: Whether one ray of each beam is chosen when all are cast.
        needs_incidence: Whether it has to know at which angle rays hit.
        needs_events: Whether it has to know all that happens to rays.
        noisy: Whether ranges have errors.
    """

    def __init__(
        self, name: str, settings: SensorSettings, pattern: BeamPattern
    ) -> None:
        self._name = name
        self._settings = settings
        self._pattern = pattern
        several = pattern.rays > 1
        self.chooses = several and not settings.combines_rays
        self.needs_incidence = settings.incidence_weights
        self.needs_events = (
            settings.return_mode != "last"
            or settings.range_resolution > 0
            or (several and not self.chooses)
        )
        self.noisy = settings.range_noise > 0 or settings.range_noise_share > 0
        self._shares = np.tile(pattern.weights, len(pattern.angles))

    def read(self, plan: PlannedScan, traces: Traces) -> Scan:
        """Make a scan of what came of its rays.

        Args:
            plan: Of this scanner.
            traces: Of its rays, with events and incidence where this scanner needs
                them.
        """
        rows = self._chosen_rows(plan, traces)
        if plan.events:
            return self._read_echoes(plan, traces, rows)
        outcomes, ranges = traces.outcomes, traces.ranges
        if rows is None:
            ranges = ranges.copy()
        else:
            outcomes, ranges = outcomes[rows], ranges[rows]
        self._measure(ranges, plan.error)
        if self._settings.spent_reads != "range":
            ranges[outcomes == Outcome.SPENT] = self._spent_range()
        return self._scan(plan, ranges, rows, partial(self._ends, plan, traces, rows))

    def _spent_range(self) -> float:
        return 0.0 if self._settings.spent_reads == "zero" else math.inf

    def _chosen_rows(self, plan: PlannedScan, traces: Traces) -> Rows | None:
        """Choose among the rays of each beam; None where there is only one.

        Returns:
            (N,) rows of the rays.
        """
        if not self.chooses:
            return None
        several = self._pattern.rays
        weights = self._shares.reshape(-1, several)
        chances = weights * backscatter(traces).reshape(-1, several)
        nowhere = ~(chances.sum(axis=1) > 0)
        chances[nowhere] = weights[nowhere]
        edges = np.cumsum(chances, axis=1)
        wanted = plan.chance * edges[:, -1]
        node = (edges[:, :-1] <= wanted[:, None]).sum(axis=1)
        return np.asarray(np.arange(len(node)) * several + node)

    def _read_echoes(
        self, plan: PlannedScan, traces: Traces, rows: Rows | None
    ) -> Scan:
        settings = self._settings
        weights = self._shares if self._pattern.rays > 1 else np.ones(len(plan.sides))
        if rows is not None:
            weights = np.zeros(len(plan.sides))
            weights[rows] = 1.0
        densities = plan.tracer.densities(plan.rays.ray_classes[0])
        columns = extract_echoes(
            traces, weights, self._pattern.rays, densities, settings
        )
        if plan.rain.size:
            stand = self._middle_rows() if rows is None else rows
            shown = speckle(plan.tracer, traces.events, stand, plan.rain, settings)
            columns = with_rain(columns, shown, stand)
        columns = merge(columns, settings.range_resolution)
        self._measure(columns.t, plan.error[columns.beam] if self.noisy else None)
        mode, beams = MODES[settings.return_mode], len(self._pattern.angles)
        chosen = choose(columns, mode, beams, settings.echo_threshold)
        if settings.spent_reads == "nothing":
            spent = np.flatnonzero(columns.kind == SPENT)
            chosen[np.isin(chosen, spent)] = -1
        found = np.flatnonzero(chosen >= 0)
        ranges = np.full(len(chosen), np.inf)
        ranges[found] = columns.t[chosen[found]]
        rays = self._middle_rows() if rows is None else rows.copy()
        rays[found] = columns.row[chosen[found]]
        if settings.spent_reads == "zero":
            ranges[found[traces.outcomes[rays[found]] == Outcome.SPENT]] = 0.0
        if settings.return_mode != "all":
            columns = columns.take(chosen[found])
        return self._scan(plan, ranges, rays, partial(self._echoes, plan, columns))

    def _middle_rows(self) -> Rows:
        """Give a ray of each beam that stands for it where no one was chosen."""
        several = self._pattern.rays
        return np.arange(len(self._pattern.angles)) * several + several // 2

    def _measure(self, ranges: Floats, error: Floats | None) -> None:
        """Make ranges as uncertain and as coarse as the sensor is, in place."""
        settings = self._settings
        if not (self.noisy or settings.range_quantum):
            return
        there = np.isfinite(ranges)
        if error is not None and error.size:
            found = ranges[there]
            deviation = np.maximum(
                settings.range_noise, settings.range_noise_share * found
            )
            moved = found + error[there] * deviation
            ranges[there] = np.clip(moved, 0.0, settings.max_range)
        if settings.range_quantum:
            most = math.floor(settings.max_range / settings.range_quantum * (1 + 1e-12))
            whole = np.rint(ranges[there] / settings.range_quantum)
            ranges[there] = np.minimum(whole, most) * settings.range_quantum

    def _scan(
        self,
        plan: PlannedScan,
        ranges: Floats,
        rows: Rows | None,
        find_echoes: Callable[[], Echoes],
    ) -> Scan:
        rays, sides = plan.rays, plan.sides
        if rows is not None:
            rays, sides = rays.take(rows), sides[rows]
        return Scan(
            sensor=self._name,
            pose=plan.pose,
            angles=self._pattern.angles,
            ranges=ranges,
            rays=sides if self._settings.has_side_rays else None,
            range_min=self._settings.min_range,
            range_max=self._settings.max_range,
            resolution=math.radians(self._settings.resolution_deg),
            cast=rays,
            find_echoes=find_echoes,
        )

    def _echoes(self, plan: PlannedScan, columns: EchoColumns) -> Echoes:
        return Echoes(
            beams=columns.beam,
            sides=plan.sides[columns.row],
            ranges=columns.t,
            kinds=columns.kind,
            power=columns.power,
            strength=columns.strength,
            parts=columns.part,
            scene_parts=plan.tracer.parts,
            settings=self._settings,
        )

    def _ends(self, plan: PlannedScan, traces: Traces, rows: Rows | None) -> Echoes:
        """Give the last echoes alone, for which nothing else need be known."""
        rows = np.arange(len(self._pattern.angles)) if rows is None else rows
        columns = ray_ends(traces, rows, self._settings.penetration_power)
        if self._settings.spent_reads == "nothing":
            columns = columns.take(columns.kind != SPENT)
        error = plan.error[columns.beam] if self.noisy else None
        self._measure(columns.t, error)
        return self._echoes(plan, columns)
