"""Draw and aim the rays of many scans.

Random numbers are drawn scan by scan, so that each generator is used as if the scans
were taken one after the other. Everything else is done for all scans of equal sensors
in a few compiled calls.
"""

from collections import defaultdict
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from radarsim.geometry import Pose3
from radarsim.raycast.rays import Rays
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer
from radarsim.sensors.beams import BeamPattern, Sides
from radarsim.sensors.hidden_rays import SensorPlaces, centre_hidden_rays
from radarsim.sensors.measurement import Draws, PlannedScan

if TYPE_CHECKING:
    from radarsim.sensors.range_scanner import RangeScanner


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
    """Planned scans whose rays are traced in one call.

    Attributes:
        indices: The number of each scan among all that were requested.
        plans: The plan of each.
        rays: The rays of all, scan by scan.
        events: Whether tracing must record the events along the rays.
        incidence: Whether tracing must record the angles of incidence.
    """

    indices: list[int]
    plans: list[PlannedScan]
    rays: Rays
    events: bool
    incidence: bool


def plan_scans(
    tracer: Tracer, requests: Sequence[ScanRequest], boxes: Boxes | None = None
) -> list[ScanGroup]:
    """Draw the rays of scans and aim them.

    Which random numbers are drawn depends on the scene only in whether it rains there,
    so that moving robots do not change the numbers drawn next.

    Args:
        tracer: Tracer of the scene; it finds side rays that start behind an opaque
            surface, which the centre ray replaces.
        requests: The scans.
        boxes: Boxes of the robots.

    Returns:
        The scans; those that need events or incidence apart from the others, for which
        recording these would cost time.

    Raises:
        ValueError: If an rng is needed and missing.
    """
    draws = [
        request.scanner.draw(request.rng, is_raining=tracer.has_rain)
        for request in requests
    ]
    equal: defaultdict[tuple[bool, bool, BeamPattern], list[int]] = defaultdict(list)
    for i, (request, draw) in enumerate(zip(requests, draws, strict=True)):
        scanner = request.scanner
        equal[draw.events, scanner.needs_incidence, scanner.pattern].append(i)
    groups: defaultdict[tuple[bool, bool], list[_EqualScans]] = defaultdict(list)
    for (events, incidence, _), members in equal.items():
        some = [requests[i] for i in members]
        aimed = _aim(tracer, some, [draws[i] for i in members], boxes)
        groups[events, incidence].append(_EqualScans(members, *aimed))
    return [
        _plan_group(tracer, requests, draws, batches) for batches in groups.values()
    ]


class _EqualScans(NamedTuple):
    """Scans of equal sensors: which they are, their rays, and the rays' sides."""

    indices: list[int]
    rays: Rays
    sides: Sides


def _plan_group(
    tracer: Tracer,
    requests: Sequence[ScanRequest],
    draws: Sequence[Draws],
    batches: Sequence[_EqualScans],
) -> ScanGroup:
    """Join scans of sensors whose rays are traced in one call."""
    scanner = requests[batches[0].indices[0]].scanner
    indices: list[int] = []
    plans: list[PlannedScan] = []
    for batch in batches:
        size = len(batch.sides) // len(batch.indices)
        for k, i in enumerate(batch.indices):
            start, end = k * size, (k + 1) * size
            plan = PlannedScan(
                tracer,
                requests[i].pose,
                batch.sides[start:end],
                # Not the joined rays, whose classes are those of all sensors.
                batch.rays,
                start,
                draws[i],
                scanner.needs_incidence,
            )
            plans.append(plan)
        indices += batch.indices
    rays = Rays.concatenate([batch.rays for batch in batches])
    events = draws[indices[0]].events
    return ScanGroup(indices, plans, rays, events, scanner.needs_incidence)


def _aim(
    tracer: Tracer,
    requests: Sequence[ScanRequest],
    draws: Sequence[Draws],
    boxes: Boxes | None,
) -> tuple[Rays, Sides]:
    """Aim the rays of scans of equal sensors; return them and their sides."""
    scanner = requests[0].scanner
    pattern = scanner.pattern
    places = SensorPlaces(
        tracer,
        boxes,
        scanner.medium,
        np.array([request.pose.numbers() for request in requests], np.float64),
        np.array([request.carrier_id for request in requests], np.int64),
    )
    aimed = pattern.aim(places.poses, [draw.beams for draw in draws])
    if pattern.radius:
        centre_hidden_rays(places, pattern, aimed)
    carrier_ids = None
    if any(request.carrier_id >= 0 for request in requests):
        carrier_ids = np.repeat(places.carrier_ids, pattern.rays_per_scan)
    return scanner.template.rays_from(aimed, carrier_ids), aimed.sides
