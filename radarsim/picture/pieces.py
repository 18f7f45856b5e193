"""Rays cut into pieces, each with the share of the power that is left on it.

Theory of operation
===================
Power changes at what happens to a ray, and between two such events in a straight line:
it stays where nothing is, and falls evenly inside volumes. So a ray is cut at its
events, and where it falls into pieces so short that no piece loses much; then one
shade for each of them shows how it fades. A sheet takes its toll at one point, which
the next piece shows; at a mirror the way turns.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import Tracer

FALL: Final = 1 / 12  # share of the full power that one piece may lose


class Pieces(NamedTuple):
    """Pieces of rays, ray by ray, the nearest first; none has no length.

    Attributes:
        rays: (P,) int64, the number of the ray.
        starts: (P,) m from the start of the ray.
        ends: (P,) m from the start of the ray.
        shares: (P,) 0 to 1, what is left halfway; 1 if the power is unlimited.
        lines: (P, 2, 2) m, both ends seen from above, map frame.
    """

    rays: NDArray[np.int64]
    starts: Floats
    ends: Floats
    shares: Floats
    lines: Floats


def cut(tracer: Tracer, rays: Rays) -> Pieces:
    """Follow rays and cut them where their power changes.

    Raises:
        EngineError: If a column of the rays is not what it has to be.
    """
    events = tracer.trace(rays, events=True).events
    ray, t = events["ray"], events["t"]
    arriving = _shares(events["power"], rays.power[ray])
    leaving = _shares(_behind(events), rays.power[ray])
    first = np.diff(ray, prepend=-1) > 0
    start = np.where(first, 0.0, np.roll(t, 1))
    share = np.where(first, 1.0, np.roll(leaving, 1))
    fall = np.maximum(share - arriving, 0.0)
    # by rounding, what falls by a whole number of twelfths may fall by a little more
    counts = np.maximum(np.ceil(fall / FALL - 1e-9), 1).astype(np.int64)
    counts[t <= start] = 0
    each = np.repeat(np.arange(len(events)), counts)
    rank = np.arange(len(each)) - np.repeat(np.cumsum(counts) - counts, counts)
    step = (t - start)[each] / counts[each]
    starts = start[each] + rank * step
    ends = np.where(rank + 1 == counts[each], t[each], starts + step)
    shares = share[each] - fall[each] * (rank + 0.5) / counts[each]
    there = np.column_stack([events["x"], events["y"]])
    before = np.where(first[:, None], rays.origins[ray, :2], np.roll(there, 1, axis=0))
    way = (there - before)[each] / counts[each, None]
    near = before[each] + rank[:, None] * way
    lines = np.stack([near, near + way], axis=1)
    return Pieces(ray[each], starts, ends, shares, lines)


def _shares(power: Floats, full: Floats) -> Floats:
    """Give powers as shares of full ones; 1 where these have no end, or are none."""
    limited = np.isfinite(full) & (full > 0)
    return np.where(limited, power, 1.0) / np.where(limited, full, 1.0)


def _behind(events: NDArray[np.void]) -> NDArray[np.float64]:
    """Give the power behind each event: behind sheets, less than in front of them."""
    return np.asarray(events["power"] - events["kept"])
