"""Points that reflect as a whole: corner reflectors, spheres, and the like."""

import math
from typing import NamedTuple

import numpy as np

from radarsim.addons.fmcw.beat_signal import Tones
from radarsim.addons.fmcw.radar_equation import (
    doppler_shift,
    elevation_pattern,
    gaussian,
    noise_power,
    received_power,
    rows_in_beam,
)
from radarsim.geometry import Floats, Pose3
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.raycast.attenuation import EventKind
from radarsim.raycast.rays import RayClass, Rays
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer

CLEARANCE = 1e-3  # m; a surface this near a point does not hide it


class Points(NamedTuple):
    """Points that reflect; N of them.

    Attributes:
        positions: (N, 3) m, map frame.
        rcs: (N,) m^2, their radar cross sections.
    """

    positions: Floats
    rcs: Floats


def point_tones(
    settings: FmcwSettings,
    pose: Pose3,
    points: Points,
    loss_db: Floats,
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Tones:
    """Return the tones of points in the directions whose beams they are in.

    Args:
        settings: The radar.
        pose: Pose of its antenna, map frame.
        points: N points.
        loss_db: (N,) loss on the way to each, dB one way; inf if it is hidden.
        velocity: Of the antenna, m/s, map frame.
    """
    seen = (points.positions - pose.position()) @ pose.rotation()
    distance = np.linalg.norm(seen, axis=1)
    visible = np.isfinite(loss_db) & (distance > 0)
    seen, distance = seen[visible], distance[visible]
    azimuth = -np.arctan2(seen[:, 1], seen[:, 0])
    elevation = np.arcsin(np.clip(seen[:, 2] / distance, -1, 1))
    half = rows_in_beam(settings)
    rows = np.rint(azimuth / settings.step)[:, None] + np.arange(-half, half + 1)
    across = gaussian(
        rows * settings.step - azimuth[:, None], math.radians(settings.beamwidth_az_deg)
    )
    pattern = across * elevation_pattern(settings, elevation)[:, None]
    power = received_power(settings, points.rcs[visible], distance)
    power *= 10 ** (-loss_db[visible] / 5) / noise_power(settings)
    speeds = (seen @ (pose.rotation().T @ np.array(velocity))) / distance
    ranges = distance + doppler_shift(settings, speeds)
    wide = np.ones_like(rows)
    phases = -4 * math.pi * distance / settings.wavelength
    return Tones(
        (rows.astype(np.int64) % settings.azimuths).ravel(),
        (ranges[:, None] * wide).ravel(),
        (phases[:, None] * wide).ravel(),
        (power[:, None] * pattern**2).ravel(),
    )


class Sight(NamedTuple):
    """How points are looked at.

    Attributes:
        ray_class: Class of the radar's rays.
        power: The power with which they start.
        boxes: The robots.
        carrier_id: The robot that carries the radar; -1 for none.
    """

    ray_class: RayClass
    power: float
    boxes: Boxes | None = None
    carrier_id: int = -1


def losses_to(tracer: Tracer, pose: Pose3, points: Points, sight: Sight) -> Floats:
    """Return the loss on the way to points, (N,) dB one way; inf if one is hidden.

    Args:
        tracer: Tracer of the scene.
        pose: Pose of the antenna, map frame.
        points: The points.
        sight: How they are looked at.
    """
    offsets = points.positions - pose.position()
    distance = np.linalg.norm(offsets, axis=1)
    loss = np.full(len(distance), np.inf)
    rows = np.flatnonzero(distance > CLEARANCE)
    if not len(rows):
        return loss
    rays = Rays(
        np.broadcast_to(pose.position(), (len(rows), 3)).copy(),
        offsets[rows] / distance[rows, None],
        distance[rows] - CLEARANCE,
        np.full(len(rows), sight.power),
        np.zeros(len(rows), np.uint8),
        np.full(len(rows), sight.carrier_id, np.int64),
        (sight.ray_class._replace(max_reflections=0),),
    )
    for event in tracer.trace(rays, sight.boxes, events=True).events:
        if event["kind"] == EventKind.OUT_OF_RANGE:
            spent = sight.power - event["power"]
            loss[rows[event["ray"]]] = spent / sight.ray_class.power_per_db
    return loss
