"""Many scans in one cast."""

from collections import defaultdict
from collections.abc import Sequence

from radarsim.raycast.rays import Rays
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer
from radarsim.sensors.measurement import PlannedScan
from radarsim.sensors.range_scanner import RangeScanner
from radarsim.sensors.scan import Scan


def scan_batch(
    tracer: Tracer,
    planned: Sequence[tuple[RangeScanner, PlannedScan]],
    boxes: Boxes | None = None,
) -> list[Scan]:
    """Take scans that are planned, in as few casts as they need.

    Those that need more than ranges are cast apart from the others, for which writing
    everything down would cost time.

    Args:
        tracer: Of the scene for which the scans are planned.
        planned: Each scanner with its plan.
        boxes: Robots.

    Returns:
        The scans in the same order.
    """
    alike: defaultdict[tuple[bool, bool], list[int]] = defaultdict(list)
    for i, (_, plan) in enumerate(planned):
        alike[plan.events, plan.incidence].append(i)
    scans: dict[int, Scan] = {}
    for (events, incidence), rows in alike.items():
        rays = [planned[i][1].rays for i in rows]
        traces = tracer.trace(
            Rays.concatenate(rays), boxes, events=events, incidence=incidence
        )
        pieces = traces.split([len(batch.max_range) for batch in rays])
        for i, piece in zip(rows, pieces, strict=True):
            scanner, plan = planned[i]
            scans[i] = scanner.read(plan, piece)
    return [scans[i] for i in range(len(planned))]
