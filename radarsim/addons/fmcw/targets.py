"""Converts targets in a spectrum to the ranges of a range scanner's beams.

Theory of operation
===================
Each azimuth of the radar belongs to the nearest beam; a beam without azimuths has no
return. The return mode selects a target of each beam: ``first`` selects the nearest
target, ``strongest`` the target with most power (the nearest if powers are equal), and
``last`` and ``all`` the farthest. Targets beyond the maximum range or outside of the
field of view are ignored.
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
    """Detect the targets in a spectrum of a revolution or of some azimuths.

    Args:
        spectrum: The spectrum.
        settings: Settings of the scanner, with its detector.
    """
    found = spectrum.detections(
        settings.detector, pfa=settings.detector_pfa, count=settings.detector_count
    )
    beams = beams_of(found.angles, settings)
    seen = (beams >= 0) & (found.ranges <= settings.max_range)
    # The fields of ``Targets`` are the beams and the last fields of ``Detections``.
    columns = (column[seen] for column in (beams, *found[3:]))
    return join_targets([Targets._make(columns)])


def join_targets(parts: Sequence[Targets]) -> Targets:
    """Join the targets of several parts of a revolution, sorted by beam and range."""
    whole = Targets._make(map(np.concatenate, zip(*parts, strict=True)))
    order = np.lexsort((whole.ranges, whole.beams))
    return Targets._make(column[order] for column in whole)


def beams_of(angles: Floats, settings: SensorSettings) -> NDArray[np.int64]:
    """Return the beam nearest to each angle, rad; -1 outside the field of view."""
    turned = np.degrees(np.remainder(angles + math.pi, 2 * math.pi) - math.pi)
    steps = (turned + settings.fov_deg / 2) / settings.resolution_deg
    # Angles in the middle between two beams belong to the left beam; 1e-9 is a
    # tolerance for rounding errors.
    beams = np.floor(steps + 0.5 + 1e-9).astype(np.int64)
    # On a full circle the first beam follows the last one.
    beams %= max(round(360 / settings.resolution_deg), settings.beams)
    return np.where(beams < settings.beams, beams, -1)


def read_ranges(targets: Targets, settings: SensorSettings) -> Floats:
    """Return the range of each beam, (N,) m; inf for a beam without target."""
    ranges = np.full(settings.beams, np.inf)
    order = np.arange(len(targets.beams))[::-1]  # the nearest target is written last
    if settings.return_mode == "strongest":
        # The sort is stable, so the nearest of equally strong targets is written last.
        order = order[np.argsort(targets.dbm[order], kind="stable")]
    elif settings.return_mode != "first":
        order = order[::-1]
    for row in order.tolist():
        ranges[targets.beams[row]] = targets.ranges[row]
    if settings.fov_deg == 360:  # the first and the last beam are the same
        ranges[0] = ranges[-1] = min(ranges[0], ranges[-1])
    return ranges
