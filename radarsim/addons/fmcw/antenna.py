"""The antenna of an FMCW radar: its beam pattern, and its poses during a revolution.

One-way patterns are relative to the middle of the beam. Echoes pass the antenna twice,
so their power is multiplied by the square of the pattern. Settings of shoulders and
sidelobes are two-way.

In azimuth the pattern is a Gaussian. Beyond one beamwidth from the middle it may have
shoulders, whose decibels fall linearly with the angle; everywhere else there are
sidelobes of constant level. In elevation the pattern is also a Gaussian, which a
cosecant-squared fan may extend below the horizon. With this fan a point at a given
depth below the antenna returns the same power at all ranges. The gain is computed from
the pattern without sidelobes: G = 16 ln 2 / (az el) for a Gaussian beam.

Source: M. I. Skolnik, Introduction to Radar Systems.
"""

import math
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from radarsim.engine import engine
from radarsim.geometry import Floats, Pose3, wrap_angle
from radarsim.presets.fmcw_settings import FmcwSettings

# The main lobe is cut off at this angle, in beamwidths, where its two-way level is -38
# dB.
REACH: Final = 1.25
_STEPS = 20_001  # samples of the numerical integrals over angles


def gaussian(angles: ArrayLike, beamwidth: float) -> Floats:
    """Return the one-way power pattern of a Gaussian beam, which is 1 in the middle.

    Args:
        angles: Angles from the middle of the beam.
        beamwidth: Width between the half-power points, in the same unit.
    """
    return np.asarray(np.exp(-4 * math.log(2) * (np.asarray(angles) / beamwidth) ** 2))


def azimuth_pattern(settings: FmcwSettings, angles: ArrayLike) -> Floats:
    """Return the antenna's one-way power pattern in azimuth, without sidelobes."""
    widths = np.abs(angles) / math.radians(settings.beamwidth_az_deg)
    fallen = settings.shoulder_db - settings.shoulder_slope_db * (widths - 1)
    shoulders = np.where(widths < 1, 0.0, 10 ** (fallen / 20))
    return np.maximum(gaussian(widths, 1.0), shoulders)


def elevation_pattern(settings: FmcwSettings, elevations: ArrayLike) -> Floats:
    """Return the antenna's one-way power pattern at elevations, rad."""
    angles = np.asarray(elevations, np.float64)
    width = math.radians(settings.beamwidth_el_deg)
    power = gaussian(angles, width)
    if settings.fan_deg:
        edge = width / 2
        below = np.clip(-angles, edge, math.pi / 2)
        level = 0.5 * 10 ** (settings.fan_db / 10)
        filled = level * (math.sin(edge) / np.sin(below)) ** 2
        is_fan = (angles < -edge) & (angles >= -math.radians(settings.fan_deg))
        power = np.where(is_fan, np.maximum(power, filled), power)
    return power


def elevation_limits(settings: FmcwSettings) -> tuple[float, float]:
    """Return the elevations of the lower and the upper edge of the beam, rad."""
    upper = REACH * math.radians(settings.beamwidth_el_deg)
    return -max(upper, math.radians(settings.fan_deg)), upper


@lru_cache(maxsize=16)
def directivity(settings: FmcwSettings) -> float:
    """Return the gain in the middle of the beam, relative to an isotropic antenna.

    The gain of a Gaussian beam is 16 ln 2 / (az el), with its beamwidths in rad.
    """
    low, high = -math.pi / 2, math.pi / 2
    elevations = np.linspace(low, high, _STEPS)
    height = float(elevation_pattern(settings, elevations).mean() * (high - low))
    azimuths = np.linspace(-math.pi, math.pi, _STEPS)
    width = float(azimuth_pattern(settings, azimuths).mean() * 2 * math.pi)
    return 4 * math.pi / (width * height)


def rows_in_beam(settings: FmcwSettings) -> int:
    """Return how many azimuths on each side of a point receive the point's echo.

    The beam is the main lobe, and the part of its shoulders that exceeds the sidelobes.
    """
    widths = (settings.shoulder_db - settings.sidelobe_db) / settings.shoulder_slope_db
    reach = max(1.5, 1 + widths) * math.radians(settings.beamwidth_az_deg)
    return max(math.ceil(min(reach, math.pi / 2) / settings.step), 1)


def pattern_table(settings: FmcwSettings) -> Floats:
    """Return the antenna's two-way power pattern in azimuth, (F, 2 half + 2).

    Row ``f`` is for columns that begin f / F of an azimuth step clockwise from an
    azimuth of the radar; the entries are for the azimuths from ``half`` before it to
    ``half + 1`` after it.
    """
    half, parts = rows_in_beam(settings), settings.rays_across
    steps = np.arange(-half, half + 2)[None, :] - np.arange(parts)[:, None] / parts
    return azimuth_pattern(settings, steps * settings.step) ** 2


Velocity = tuple[float, float, float]  # m/s, map frame

STANDING: Velocity = (0.0, 0.0, 0.0)


class Viewpoints(NamedTuple):
    """The state of the antenna at each of N azimuths.

    Attributes:
        positions: Positions, (N, 3) m, map frame.
        rotations: Rotation matrices from the antenna to the map frame, (N, 3, 3).
        velocities: Velocities, (N, 3) m/s, map frame.
        times: Times, (N,) s.
    """

    positions: Floats
    rotations: Floats
    velocities: Floats
    times: Floats

    def of(self, which: slice) -> "Viewpoints":
        """Return the states of the antenna at the given indices."""
        return Viewpoints._make(column[which] for column in self)


def fixed_viewpoints(
    pose: Pose3, times: Floats, velocity: Velocity = STANDING
) -> Viewpoints:
    """Return the states of an antenna at a fixed pose, for each azimuth."""
    count = len(times)
    return Viewpoints(
        np.tile(pose.position(), (count, 1)),
        np.tile(pose.rotation(), (count, 1, 1)),
        np.tile(np.array(velocity, np.float64), (count, 1)),
        times,
    )


def moving_viewpoints(
    start: Pose3, end: Pose3, times: Floats, velocity: Velocity
) -> Viewpoints:
    """Return the states of an antenna that moves at constant speed, for each azimuth.

    Args:
        start: Pose of the antenna at the first azimuth.
        end: Pose of the antenna one step after the last azimuth.
        times: Times of the azimuths, (N,) s.
        velocity: Velocity of the antenna, m/s, map frame.
    """
    if start == end:
        return fixed_viewpoints(end, times, velocity)
    angles = [
        wrap_angle(last - first)
        for first, last in zip(start.numbers()[3:], end.numbers()[3:], strict=True)
    ]
    first = np.array(start.numbers())
    change = np.concatenate([end.position() - start.position(), angles])
    shares = np.arange(len(times)) / len(times)
    poses = first + shares[:, None] * change
    rotations = np.zeros((len(times), 3, 3))
    engine.fill_rotations(poses[:, 3:].copy(), rotations)
    velocities = np.tile(np.array(velocity, np.float64), (len(times), 1))
    return Viewpoints(poses[:, :3].copy(), rotations, velocities, times)
