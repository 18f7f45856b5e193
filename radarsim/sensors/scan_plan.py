"""Draw the random numbers of many scans, and aim single ones.

Random numbers are drawn scan by scan, so that each generator is used as if the scans
were taken one after the other. Everything else is done for all scans of equal sensors
in a few compiled calls.

Side rays that start behind a wall: a sensor cannot see from there.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose3
from radarsim.raycast.aimed_rays import AimedRays
from radarsim.raycast.attenuation import Outcome
from radarsim.raycast.rays import Rays
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer
from radarsim.sensors.beams import BeamPattern
from radarsim.sensors.measurement import Draws, PlannedScan

if TYPE_CHECKING:
    from radarsim.sensors.range_scanner import RangeScanner

MIDDLE_NODE: Final = 1  # of three


class SensorPlaces(NamedTuple):
    """Where J sensors of one medium are.

    Attributes:
        tracer: Tracer of the scene.
        boxes: Boxes of the robots.
        medium: ``RADAR`` or ``LASER``.
        poses: (J, 6) x, y, z, roll, pitch, yaw, map frame.
        carrier_ids: (J,) the box that carries each; -1 for none.
    """

    tracer: Tracer
    boxes: Boxes | None
    medium: int
    poses: Floats
    carrier_ids: NDArray[np.int64]


def centre_hidden_rays(
    places: SensorPlaces, pattern: BeamPattern, aimed: AimedRays
) -> None:
    """Replace side rays that start behind an opaque surface by the centre ray.

    Args:
        places: J sensors.
        pattern: The beams of all of them.
        aimed: Their rays, to be changed.
    """
    hidden = _are_hidden(places, aimed.origins)
    nodes = np.where(hidden, MIDDLE_NODE, aimed.nodes).astype(np.int16)
    centred = pattern.aim_nodes(places.poses, nodes)
    aimed.nodes[:] = centred.nodes
    aimed.sides[:] = centred.sides
    aimed.origins[:] = centred.origins
    aimed.directions[:] = centred.directions


def _are_hidden(places: SensorPlaces, starts: Floats) -> NDArray[np.bool_]:
    """Return which rays start behind an opaque surface, seen from their sensor.

    Args:
        places: J sensors.
        starts: (J * M, 3) m, map frame, the starts of their rays.
    """
    each = len(starts) // len(places.poses)
    positions = np.repeat(places.poses[:, :3], each, axis=0)
    offset = starts - positions
    length = np.linalg.norm(offset, axis=1)
    moved = np.flatnonzero(length > 0)
    to_starts = replace(
        Rays.uniform(
            positions[moved],
            offset[moved] / length[moved, None],
            max_range=0.0,
            medium=places.medium,
        ),
        max_range=length[moved],
        carrier_id=np.repeat(places.carrier_ids, each)[moved],
    )
    traces = places.tracer.trace(to_starts, places.boxes)
    hidden = np.zeros(len(starts), np.bool_)
    hidden[moved] = traces.outcomes != Outcome.NOTHING
    return hidden


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
        first = self.draws[0].range_error
        if not first.size:
            return first
        return np.concatenate([draws.range_error for draws in self.draws])

    def places(self) -> Floats:
        """Return the sensors' places, (J, 7), as in ``UnaimedScans``."""
        rows = [(*each.pose.numbers(), each.carrier_id) for each in self.requests]
        return np.array(rows, np.float64)


def draw_scans(tracer: Tracer, requests: Sequence[ScanRequest]) -> list[ScanGroup]:
    """Draw the random numbers of scans.

    Which ones are drawn depends on the scene only in whether it rains there, so that
    moving robots do not change the numbers drawn next.

    Args:
        tracer: Tracer of the scene.
        requests: The scans.

    Raises:
        ValueError: If an rng is needed and missing.
    """
    is_raining = tracer.has_rain
    if len(requests) == 1:  # the common case, without looking for equal sensors
        (request,) = requests
        draws = request.scanner.draw(request.rng, is_raining=is_raining)
        return [ScanGroup(request.scanner, [0], [request], [draws])]
    groups: dict[object, ScanGroup] = {}
    for i, request in enumerate(requests):
        scanner = request.scanner
        draws = scanner.draw(request.rng, is_raining=is_raining)
        pattern = scanner.pattern
        # Rays that are random are no nodes, which scans could share.
        key = i if pattern.has_random_rays else pattern
        group = groups.get(key)
        if group is None:
            groups[key] = ScanGroup(scanner, [i], [request], [draws])
        else:
            group.indices.append(i)
            group.requests.append(request)
            group.draws.append(draws)
    return list(groups.values())


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
    scanner = group.scanner
    pattern = scanner.pattern
    places = group.places()
    poses, carrier_ids = places[:, :6].copy(), places[:, 6].astype(np.int64)
    aimed = pattern.aim(poses, [draws.beams for draws in group.draws])
    if pattern.radius:
        sensors = SensorPlaces(tracer, boxes, scanner.medium, poses, carrier_ids)
        centre_hidden_rays(sensors, pattern, aimed)
    size = pattern.rays_per_scan
    rays = scanner.template.rays_from(aimed, np.repeat(carrier_ids, size))
    plans = []
    for k, (request, draws) in enumerate(zip(group.requests, group.draws, strict=True)):
        start, end = k * size, (k + 1) * size
        find_rays = partial(rays.rows, start, end)
        sides = aimed.sides[start:end]
        plan = PlannedScan(
            *(tracer, request.pose, sides, find_rays, draws),
            scanner.needs_incidence,
        )
        plans.append(plan)
    return plans
