"""Computes the echoes of beams from the surfaces and volumes that their rays met.

Theory of operation
===================
Every object along a ray returns an echo: each boundary of a volume that the ray
crosses, each sheet, and the surface or the point at which the ray ends.

The strength of an echo is its power relative to the echo of an unobstructed rough wall
that fills the beam at normal incidence. Penetration power is proportional to decibels
of one-way loss; the sensor's margin is the largest two-way loss. So if a ray has a
share p of its power left, the share T = 10^(-margin (1 - p) / 10) would return from
there. An opaque surface returns the T of the power left there. A volume returns the
difference of T between its two sides, and a sheet returns the difference between its
front and its back. If volumes overlap, the loss is divided between them in proportion
to density. This holds for plants, which scatter a fifth of the power they take, and for
walls that return a tenth of the power that arrives: the strengths of a ray that ends
within range then add up to 1, so the power missing from the wall's echo is in the
echoes of volumes in front of it. Materials with another albedo return more or less than
plants, and smoke returns nothing. The first object returns all power of a beam with
unlimited power. Power lost to the air, or to a volume around the ray's start, returns
no echo, since the ray crosses no boundary there.

A volume scatters along the whole path of the ray inside. Its echo has one range, up to
which half of the echo's power has returned. A sensor that keeps first echoes triggers
on the leading edge instead, at the point where the ray enters.

If the rays of a beam are combined, each has its share of the beam, and the echoes of
all rays are sorted by range. With incidence weights, an echo is multiplied by the
cosine of the angle between ray and surface normal. Rays sample the beam's solid angle,
in which a slanted surface has the area R^2 / cos and returns cos^2 per area relative to
normal incidence, by Lambert's law. Leaves face all directions and are hit in proportion
to the cosine, so their factor is 2/3, the mean of cos^2 divided by the mean of cos.

Echoes that a beam cannot resolve are merged, and then the sensor's return mode selects
the echoes that are kept.

Echoes of a beam that are closer together than the range resolution are merged: from the
nearest echo with a strength, all echoes less than one range resolution behind it, and
echoes without strength less than one range resolution in front of it. The merged echo
has the sum of their strengths and their mean range, weighted by strength. Its kind and
object are those of the strongest echo at the end of a ray; if no ray ends there, those
of the strongest echo. If that is a volume, the merged echo begins where the ray enters.
"""

import math
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import engine
from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.raycast.rays import EventKind, Outcome, Traces

NOTHING_LEFT: Final = 1e-12  # a share of a ray's power that counts as zero
LEAF_BACKSCATTER: Final = 2 / 3  # mean cosine at the leaves that rays hit
_MODES: Final = {"last": 0, "all": 0, "first": 1, "strongest": 2}  # engine's values

ECHO: Final = engine.rows["Echo"]
EchoTable: TypeAlias = NDArray[np.void]  # rows of dtype ECHO, beam by beam


def return_law(settings: SensorSettings) -> tuple[float, float, bool]:
    """Return the parameters that convert a ray's power to the power of its echo.

    Returns:
        The initial power of a ray; the margin in nepers, the natural logarithm of the
        ratio between the echoes of a ray with full power and a ray with none; and
        whether the range of a volume is measured at half its power, not at its front.
    """
    full = settings.penetration_power
    # Shares of the initial power are undefined if this power is zero or infinite.
    full = full if math.isfinite(full) else 0.0
    nepers = settings.margin_db * math.log(10) / 10
    return full, nepers, settings.return_mode != "first"


def returned_share(share: Floats | float, settings: SensorSettings) -> Floats:
    """Convert the share of power left in rays to relative echo power, from 0 to 1."""
    returned = np.exp(return_law(settings)[1] * (np.asarray(share) - 1.0))
    return np.where(np.asarray(share) > NOTHING_LEFT, returned, 0.0)


def backscatter(traces: Traces) -> Floats:
    """Return the echo power at each ray's end, relative to normal incidence, (N,).

    Without incidence angles the value is 1; for a ray that hits nothing it is 0.
    """
    if not traces.incidence.size:
        return np.isfinite(traces.ranges).astype(np.float64)
    leaves = np.where(np.isfinite(traces.ranges), LEAF_BACKSCATTER, 0.0)
    return np.where(np.isnan(traces.incidence), leaves, traces.incidence)


def extract_echoes(
    traces: Traces,
    weights: Floats,
    rays_per_beam: int,
    losses: tuple[Floats, float, Floats],
    settings: SensorSettings,
) -> EchoTable:
    """Return the echoes of all objects that rays hit or pass through.

    Args:
        traces: The traced rays, with events.
        weights: (M,) the share of each ray in its beam; a ray of weight 0 has no echo.
        rays_per_beam: Number of consecutive rays that form a beam.
        losses: Power that rays lose per metre in each part, (P,), and in the air; and
            the scattered share of the loss in each part, relative to foliage, (P,).
        settings: Settings of the sensor.

    Returns:
        The echoes, beam by beam, sorted by range; echoes at equal ranges are in the
        order of the rays, and of the events along a ray.

    Raises:
        EngineError: If the events do not belong to these rays and parts.
    """
    echoes = np.zeros(len(traces.events), ECHO)
    count = engine.extract_echoes(
        traces.events,
        weights,
        traces.incidence,
        rays_per_beam,
        *losses,
        *return_law(settings),
        echoes,
    )
    if count < 0:
        raise EngineError("events refer to rays or parts that are not in the traces")
    return echoes[:count]


def insert_echoes(echoes: EchoTable, added: EchoTable) -> EchoTable:
    """Merge two tables of echoes into one, sorted by beam and then by range."""
    joined = np.concatenate([echoes, added], dtype=ECHO)  # dtype keeps the padding
    return joined.take(np.lexsort([joined["t"], joined["beam"]]))


def extract_ray_ends(
    traces: Traces, rows: NDArray[np.int64], settings: SensorSettings
) -> EchoTable:
    """Return only the echoes at the ends of rays, which need no events along the rays.

    Args:
        traces: The traced rays.
        rows: (N,) index of the ray that represents each beam.
        settings: Settings of the sensor.
    """
    beams = np.flatnonzero(np.isfinite(traces.ranges[rows]))
    rows = rows[beams]
    hit = traces.outcomes[rows] == Outcome.HIT
    power, full = traces.power[rows], settings.penetration_power
    limited = full > 0 and np.isfinite(full)
    share = power / full if limited else np.ones(len(rows))
    strength = returned_share(share, settings) * backscatter(traces)[rows]
    echoes = np.zeros(len(rows), ECHO)
    echoes["beam"], echoes["row"] = beams, rows
    echoes["t"] = echoes["front"] = traces.ranges[rows]
    echoes["part"], echoes["power"] = traces.parts[rows], power
    echoes["strength"] = np.where(hit, strength, 0.0)
    echoes["kind"] = np.where(hit, EventKind.HIT, EventKind.SPENT)
    echoes["ends"] = True
    return echoes


def merge_echoes(echoes: EchoTable, resolution: float) -> EchoTable:
    """Merge echoes of a beam that are closer together than a resolution, m."""
    if resolution <= 0:
        return echoes
    merged = np.zeros(len(echoes), ECHO)
    return merged[: engine.merge_echoes(echoes, resolution, merged)]


def select_echoes(
    echoes: EchoTable,
    settings: SensorSettings,
    ranges: Floats,
    rays: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Select the echo that each beam reports, and set the beam's range and ray.

    Among equally strong echoes, the nearest is selected. If no echo of a beam exceeds
    the sensor's threshold, the beam has the range at which its ray ends.

    Args:
        echoes: Echoes of all beams.
        settings: Settings of the sensor.
        ranges: (N,) m, set in place; unchanged for a beam without a selected echo.
        rays: (N,) index of the ray of each range, set in place in the same way.

    Returns:
        The rows of the selected echoes, beam by beam.
    """
    selected = np.zeros(len(ranges), np.int64)
    count = engine.select_echoes(
        echoes,
        _MODES[settings.return_mode],
        settings.echo_threshold,
        settings.spent_reads != "nothing",
        selected,
        ranges,
        rays,
    )
    return selected[:count]
