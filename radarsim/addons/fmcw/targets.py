"""Targets that a detector finds in a spectrum, as beams of a range scanner read them.

Theory of operation
===================
A direction of the radar belongs to the beam that is nearest to it; a beam to which none
belongs has no return. Of the targets of a beam, the return mode selects one: ``first``
the nearest, ``strongest`` that of most power, of equally strong ones the nearest, and
``last`` and ``all`` the farthest. Targets beyond the maximum range, or outside the
field of view, are left out.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.sensors.scan import Targets

if TYPE_CHECKING:
    from radarsim.addons.fmcw.spectrum import Spectrum


def find_targets(spectrum: "Spectrum", settings: SensorSettings) -> Targets:
    """Detect the targets in a spectrum, or in some directions of one.

    Args:
        spectrum: The spectrum.
        settings: Those of the scanner, with its detector.
    """
    found = spectrum.detections(
        settings.detector, pfa=settings.detector_pfa, count=settings.detector_count
    )
    beams = beams_of(found.angles, settings)
    seen = (beams >= 0) & (found.ranges <= settings.max_range)
    # The columns of targets are the last ones of detections.
    columns = (column[seen] for column in (beams, *found[3:]))
    return join_targets([Targets._make(columns)])


def join_targets(parts: Sequence[Targets]) -> Targets:
    """Return the targets of several parts of a turn."""
    whole = Targets._make(map(np.concatenate, zip(*parts, strict=True)))
    order = np.lexsort((whole.ranges, whole.beams))
    return Targets._make(column[order] for column in whole)


def beams_of(angles: Floats, settings: SensorSettings) -> NDArray[np.int64]:
    """Return the beam nearest to each angle, rad; -1 outside the field of view."""
    turned = np.degrees(np.remainder(angles + math.pi, 2 * math.pi) - math.pi)
    steps = (turned + settings.fov_deg / 2) / settings.resolution_deg
    # Angles in the middle between two beams go to the left one, in spite of rounding.
    beams = np.floor(steps + 0.5 + 1e-9).astype(np.int64)
    # Straight back is to the left of the last beam, and to the right of the first.
    beams %= max(round(360 / settings.resolution_deg), settings.beams)
    return np.where(beams < settings.beams, beams, -1)


def read_ranges(targets: Targets, settings: SensorSettings) -> Floats:
    """Return the range that each beam reads, (N,) m; inf where it has no target."""
    ranges = np.full(settings.beams, np.inf)
    order = np.arange(len(targets.beams))[::-1]  # the nearest is written last
    if settings.return_mode == "strongest":
        # Stable: of equally strong ones, the nearest stays the last to be written.
        order = order[np.argsort(targets.dbm[order], kind="stable")]
    elif settings.return_mode != "first":
        order = order[::-1]
    for row in order.tolist():
        ranges[targets.beams[row]] = targets.ranges[row]
    if settings.fov_deg == 360:  # the first and the last beam are the same
        ranges[0] = ranges[-1] = min(ranges[0], ranges[-1])
    return ranges
