"""Where lasers that read first returns answer in smoke, dust and fog.

Theory of operation
===================
Each grain of a cloud sends light back, so a beam can answer at any depth. Of beams that
have gone r metres into a cloud, a share exp(-2 a r) has not answered, for the light has
to come back as well; a is the one-way extinction coefficient, 1/m: ln(10) / 10 times
the decibels per metre, summed over clouds that overlap. So the optical depth, 2 a r, at
which a beam answers is distributed exponentially with mean 1; it is drawn once for each
beam. A beam that starts inside a cloud answers by the same law, and one that meets a
surface before that depth reads the surface, however weak.

The penetration power that a beam loses in a cloud, of all that it has, times the
sensor's margin in nepers, is that optical depth: margins count out and back.
"""

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.raycast.attenuation import EventKind, Events
from radarsim.sensors.echo_extraction import (
    ECHO,
    EchoTable,
    insert_echoes,
    return_law,
    returned_share,
)

Rows = NDArray[np.int64]


def answer_in_clouds(
    echoes: EchoTable,
    events: Events,
    density: Floats,
    drawn: Floats,
    settings: SensorSettings,
) -> EchoTable:
    """Replace the echoes of clouds' edges by answers from inside of them.

    A beam ends where it answers: its echo is of the kind ``ENTER`` and an end, and
    begins where the ray enters the cloud, or at the sensor.

    Args:
        echoes: All echoes of beams of one ray each.
        events: EVENT of all rays.
        density: (P,) power lost per metre in each part that is a cloud; otherwise 0.
        drawn: (J, N) optical depth at which each beam of J scans answers.
        settings: Settings of the sensor.
    """
    full, nepers, _ = return_law(settings)
    change = _density_changes(events, density)
    beams, ranges, before = _find_answers(events, change, drawn * full / nepers)
    last = np.full(drawn.size, np.inf)
    last[beams] = ranges
    is_edge = echoes["kind"] == EventKind.ENTER
    is_edge[is_edge] = density[echoes["part"][is_edge]] > 0
    is_kept = ~is_edge & (echoes["t"] <= last[echoes["beam"]])
    kept = echoes.take(np.flatnonzero(is_kept))
    around = _innermost_clouds(events, change, beams, before)
    near = events["t"][before - 1]
    left = events["power"][before - 1] - events["absorbed"][before - 1]
    way = events["t"][before] - near
    gone = np.divide(ranges - near, way, out=np.zeros(len(way)), where=way > 0)
    power = left + gone * (events["power"][before] - left)
    added = np.zeros(len(beams), ECHO)
    added["beam"] = added["row"] = beams
    added["t"], added["front"] = ranges, events["t"][around]
    added["part"], added["power"] = events["part"][around], power
    added["strength"] = returned_share(power / full, settings)
    added["kind"], added["ends"] = EventKind.ENTER, True
    return insert_echoes(kept, added)


def _density_changes(events: Events, density: Floats) -> Floats:
    """Return by how much the density of clouds rises at each event, (V,)."""
    kinds, change = events["kind"], np.zeros(len(events))
    entering = EventKind.ENTER, EventKind.START_INSIDE
    for kinds_of, sign in ((entering, 1.0), ((EventKind.LEAVE,), -1.0)):
        rows = np.isin(kinds, kinds_of)
        change[rows] = sign * density[events["part"][rows]]
    return change


def _find_answers(
    events: Events, change: Floats, budgets: Floats
) -> tuple[Rows, Floats, Rows]:
    """Find where the power lost in clouds reaches the budget of each beam, (J, N).

    Returns:
        Of the A beams that answer their numbers, ranges, m, and the events behind.
    """
    budget, (scans, size) = budgets.ravel(), budgets.shape
    rays, t = events["ray"], events["t"]
    first = np.searchsorted(rays, np.arange(len(budget)))[rays]
    # Summed for each scan alone, so that others do not change how sums are rounded.
    cuts = np.searchsorted(rays, np.arange(1, scans) * size)
    # density up to each event, over all rays
    before = _sums(change, cuts) - change
    inside = before - before[first]
    lost = _sums(inside * np.diff(t, prepend=0.0), cuts)
    lost -= lost[first]
    reached = np.flatnonzero((lost > budget[rays]) & (inside > 0))
    beams, rows = np.unique(rays[reached], return_index=True)
    stops = reached[rows]
    ranges = t[stops] - (lost[stops] - budget[beams]) / inside[stops]
    return beams, np.clip(ranges, t[stops - 1], t[stops]), stops


def _sums(values: Floats, cuts: Rows) -> Floats:
    return np.concatenate([np.cumsum(some) for some in np.split(values, cuts)])


def _innermost_clouds(
    events: Events, change: Floats, beams: Rows, before: Rows
) -> Rows:
    """Return the event with which the last entered cloud of each answer began.

    Args:
        events: All.
        change: By how much the density of clouds rises at each.
        beams: (A,) the beam of each answer.
        before: (A,) the event behind it.
    """
    rays, parts, rows = events["ray"], events["part"], np.flatnonzero(change)
    # A part is left before it is entered again: its next event is where it ends.
    order = rows[np.lexsort((rows, parts[rows], rays[rows]))]
    one, other = order[:-1], order[1:]
    same = (rays[one] == rays[other]) & (parts[one] == parts[other])
    leaves = np.full(len(events), len(events))
    leaves[one[same]] = other[same]
    stops = np.full(rays.max(initial=0) + 1, -1)
    stops[beams] = before
    entered = rows[change[rows] > 0]
    stop = stops[rays[entered]]
    around = entered[(entered < stop) & (stop <= leaves[entered])]
    last = np.full(len(stops), -1)
    np.maximum.at(last, rays[around], around)
    return last[beams]
