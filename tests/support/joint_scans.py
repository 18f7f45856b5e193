"""Scans that are taken together."""

from collections.abc import Sequence

from radarsim.raycast.rays import Boxes
from radarsim.raycast.tracer import Tracer
from radarsim.sensors.scan import Scan
from radarsim.sensors.scan_batch import ScanRequest, take_scans


def scan_together(
    tracer: Tracer, requests: Sequence[ScanRequest], boxes: Boxes | None = None
) -> list[Scan]:
    """Return the scans of some requests, in their order."""
    taken = take_scans(tracer, requests, boxes)
    return [
        batch.scan(row, request.scanner.name, request.pose)
        for request, (batch, row) in zip(requests, taken, strict=True)
    ]
