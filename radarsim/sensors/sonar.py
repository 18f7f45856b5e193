"""Sonars, which read the range of the nearest surface in a cone that returns sound.

Theory of operation
===================
A cone is a bundle of 33 rays, the same in every reading. 21 rays are horizontal and, in
a cone of 20 degrees, 1 degree apart. Within 5 m, no object wider than 9 cm fits between
two of these rays, so poles are detected, and the range of a wall is wrong by less than
0.2 mm. 12 more rays, on circles at half and all of the cone's angle, detect obstacles
that are only above or below the sonar. More rays would cost time for little gain.

A surface returns sound if the angle of incidence of a ray is below the limit. Without
the limit, the floor, which every cone near the ground grazes, would hide all other
surfaces. The ray on the axis always counts. The nearest range is then clipped to the
sonar's limits.

Source: the original server's sonar casts 10 cones of 16 rays and accepts an incidence
of 10 degrees, but compares with the normal of the wrong side of the surface, so only
the ray on the axis counts. Angle, limits and rate are the original's.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar, Final

import numpy as np
from pydantic import BaseModel

from radarsim.geometry import Floats
from radarsim.presets.sensor_settings import NotNegative, Positive, RightAngle
from radarsim.protocol.reports import Sonar
from radarsim.raycast.rays import Rays, Traces
from radarsim.sensors.sensor import Mounting, Sensor, sight_rays

# The directions of the rays: angles to the left and upward, as fractions of the cone's
# half angle; the first ray is the axis.
_LEVEL: Final = [(step / 10, 0.0) for step in sorted(range(-10, 11), key=abs)]
_CIRCLES: Final = [
    (radius * math.cos(turn), radius * math.sin(turn))
    for radius in (0.5, 1.0)
    for turn in np.radians([45, 90, 135, -45, -90, -135]).tolist()
]
_ANGLES: Final = np.array([*_LEVEL, *_CIRCLES])
RAYS_PER_CONE: Final = len(_ANGLES)


class SonarSettings(BaseModel, extra="forbid", frozen=True):
    """The settings of a sonar.

    Attributes:
        beam_angle_deg: Full angle of the cone, degrees.
        min_range: Smallest reading, m; shorter ranges read as this value.
        max_range: Largest reading, m; a cone without a return reads this value.
        max_incidence_deg: Largest angle between a ray and the normal of a surface that
            returns sound, degrees; the ray on the axis has no such limit.
    """

    beam_angle_deg: RightAngle
    min_range: NotNegative
    max_range: Positive
    max_incidence_deg: RightAngle


class Sonars(Sensor, types=["Sonar"]):
    """All sonars of a robot; the rays of their cones are traced together."""

    settings: ClassVar[type[BaseModel]] = SonarSettings
    is_joined = True

    def __init__(self, *mountings: Mounting) -> None:
        """Compute the rays of all sonars in the body frame."""
        super().__init__(*mountings)
        self._in_one_report = "Sonar" in mountings[0].dialect.joined
        self._names = [mounting.item.name for mounting in mountings]
        settings = [mounting.settings for mounting in mountings]
        mounts = [mounting.item.mount for mounting in mountings]
        bundles = [
            _cone(math.radians(each.beam_angle_deg)) @ mount.rotation().T
            for mount, each in zip(mounts, settings, strict=True)
        ]
        positions = np.array([mount.position() for mount in mounts])
        self._min_range = np.array([each.min_range for each in settings])
        self._max_range = np.array([each.max_range for each in settings])
        limits = np.radians([each.max_incidence_deg for each in settings])
        self._least_cosine = np.cos(limits)[:, None]
        self._aimed = sight_rays(
            np.repeat(positions, RAYS_PER_CONE, axis=0),
            np.concatenate(bundles),
            np.repeat(self._max_range, RAYS_PER_CONE),
            self.robot.number,
        )

    def rays(self) -> Rays:
        """Return the rays of all sonars, sonar by sonar, map frame."""
        body = self.robot.body
        rotation = body.rotation().T
        return replace(
            self._aimed,
            origins=body.position() + self._aimed.origins @ rotation,
            directions=self._aimed.directions @ rotation,
        )

    def read(self, time: float, traces: Traces) -> Sequence[Sonar]:
        """Return the ranges of all sonars in one report, or a report for each sonar.

        A sonar without a return reads its maximum range.
        """
        found = traces.ranges.reshape(-1, RAYS_PER_CONE)
        cosine = traces.incidence.reshape(found.shape)
        returns = cosine >= self._least_cosine  # nan where nothing was hit
        # As in the original server, the ray on the axis counts at any angle of
        # incidence.
        returns[:, 0] = True
        nearest = np.where(returns, found, np.inf).min(axis=1)
        ranges = np.clip(nearest, self._min_range, self._max_range).tolist()
        named = tuple(zip(self._names, ranges, strict=True))
        if self._in_one_report:
            return [Sonar(time, named)]
        return [Sonar(time, (each,)) for each in named]


def _cone(beam_angle: float) -> Floats:
    """Return unit vectors in a cone around the x axis, (33, 3); the axis is first."""
    left, up = (_ANGLES * beam_angle / 2).T
    level = np.cos(up)
    return np.column_stack([level * np.cos(left), level * np.sin(left), np.sin(up)])
