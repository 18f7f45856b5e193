"""Turn the events along rays into the echoes of beams.

Theory of operation
===================
Everything that a ray meets returns an echo: each boundary of a volume that it crosses,
each sheet, and the surface or the point at which it ends.

The strength of an echo is its power as a share of what comes back from a rough wall
that the whole beam meets head-on, with nothing before it. Penetration power counts
decibels one way; the sensor's margin is what a beam can lose out and back. So of a ray
that has a share p of its power left, T = 10^(-margin (1 - p) / 10) would come back. An
opaque surface returns the T of the power left there; a volume the difference between
its two sides, and a sheet that before and behind it. Where volumes overlap, each is
credited with its share of the loss, in proportion to density. This holds for plants,
which scatter a fifth of what they take, before walls that return a tenth of what
arrives: the strengths of a ray that ends within range then add up to 1, and what does
not come back from the wall comes back from volumes before it. Another albedo returns
more or less than plants, and smoke nothing. A beam of unlimited power is
returned whole by what it hits. Power lost to the air, or to a volume around the ray's
start, returns no echo: there is no boundary.

A volume answers all along the ray's way through it, and its echo has one range: up to
there half of its power has come back. A sensor that keeps first echoes triggers on
their leading edge instead, which is where the ray enters.

Where the rays of a beam are combined, each carries its share of the beam, and the
echoes of all of them are sorted by range. With incidence weights an echo is multiplied
by what a rough surface returns of the ray: the cosine of the angle between ray and
normal. Rays sample the beam's solid angle, in which a slanted surface of R^2 / cos
returns cos^2 of what it does head-on, by Lambert's law. Leaves face all directions, and
are met in proportion to the cosine: 2/3, the mean of cos^2 over that of cos.

Echoes that a beam cannot resolve are merged, and those that it keeps are selected.

Echoes of a beam that are closer together than the range resolution merge: starting from
the nearest one that returns power, all that is less than the range resolution behind
it, and echoes without strength as close in front of it. The merged echo has the sum of
their strengths and their mean range, weighted by strength. Its kind and object are
those of the strongest end of a ray among them; if no ray ends there, those of the
strongest echo. If that is a volume, the merged echo begins where the ray enters it.
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

NOTHING_LEFT: Final = 1e-12  # share of a ray's power
LEAF_BACKSCATTER: Final = 2 / 3  # mean cosine of leaves that rays meet
_MODES: Final = {"last": 0, "all": 0, "first": 1, "strongest": 2}  # of the engine

ECHO: Final = engine.rows["Echo"]
EchoTable: TypeAlias = NDArray[np.void]  # of ECHO, a row for each, beam by beam


def return_law(settings: SensorSettings) -> tuple[float, float, bool]:
    """Return how a ray's power determines what comes back.

    Returns:
        The power with which a ray starts; the natural logarithm of the ratio between
        what comes back of a ray with all its power and of one with none; and whether
        the echo of a volume has the range of half its power, instead of that at which
        it begins.
    """
    full = settings.penetration_power
    # There is no share of no power, nor of unlimited power.
    full = full if math.isfinite(full) else 0.0
    nepers = settings.margin_db * math.log(10) / 10
    return full, nepers, settings.return_mode != "first"


def returned_share(share: Floats | float, settings: SensorSettings) -> Floats:
    """Return what comes back of rays that have these shares of their power left."""
    returned = np.exp(return_law(settings)[1] * (np.asarray(share) - 1.0))
    return np.where(np.asarray(share) > NOTHING_LEFT, returned, 0.0)


def backscatter(traces: Traces) -> Floats:
    """Return what the end of each ray returns, of what it would head-on, (N,).

    It is 1 for every end without incidence angles, and 0 for a ray without end.
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
    """Extract the echoes from the events along rays.

    Args:
        traces: The traced rays, with events.
        weights: (M,) the share of each ray in its beam; a ray of weight 0 has no echo.
        rays_per_beam: How many consecutive rays form a beam.
        losses: The power that rays lose per metre in each part, (P,), and in the air;
            and what each part scatters of a loss, relative to foliage, (P,).
        settings: Settings of the sensor.

    Returns:
        The echoes, beam by beam, sorted by range; of equal ranges, in the order of the
        rays and along them.

    Raises:
        EngineError: If the events are not of these rays and parts.
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
        raise EngineError("events of rays or parts that the traces do not have")
    return echoes[:count]


def insert_echoes(echoes: EchoTable, added: EchoTable) -> EchoTable:
    """Return some echoes and others, beam by beam, sorted by range."""
    joined = np.concatenate([echoes, added], dtype=ECHO)  # by default without padding
    return joined.take(np.lexsort([joined["t"], joined["beam"]]))


def extract_ray_ends(
    traces: Traces, rows: NDArray[np.int64], settings: SensorSettings
) -> EchoTable:
    """Extract only the echoes at the ends of rays, for which no events are needed.

    Args:
        traces: The traced rays.
        rows: (N,) the ray that stands for each beam.
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
    """Select the echo that gives each beam its range, and set its range and ray.

    Of equally strong echoes, the nearest is the strongest. A beam in which no echo is
    above the sensor's threshold has the range at which its ray ends.

    Args:
        echoes: Echoes of all beams.
        settings: Settings of the sensor.
        ranges: (N,) m, unchanged where a beam reads no echo.
        rays: (N,) the ray of each range, likewise.

    Returns:
        The rows of the echoes that are read, beam by beam.
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
