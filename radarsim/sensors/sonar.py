"""Sonars: each reads the nearest surface in its cone that sends sound back.

Theory of operation
===================
A cone is a bundle of 33 rays, the same in every reading. 21 of them are level and, in
a cone of 20 degrees, 1 degree apart: nothing that is wider than 9 cm fits between two
of them within 5 m, so that poles are found, and the nearest point of a wall is missed
by less than 0.2 mm. 12 more rays, on circles of half and all of the cone's angle, find
what is only above or below the sonar. More rays cost more than they find.

A surface sends sound back if a ray meets it within the largest angle of incidence.
Otherwise the floor, which every cone near the ground grazes, would hide all else. The
ray on the axis always counts. The nearest range is then clipped to the sonar's limits.

Source: the original server's sonar casts 10 cones of 16 rays and accepts an incidence
of 10 degrees, but compares with the wrong side of the surface: only the ray on the axis
ever counts. Angle, limits and rate are the original's.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from radarsim.geometry import Floats, Pose3
from radarsim.presets.sensor_settings import SonarSettings
from radarsim.raycast.rays import SONAR, RayClass, Rays, Traces

SONAR_CLASS: Final = RayClass(SONAR)

# The directions of the rays as angles to the left and upward, in half angles of the
# cone; the first is the axis.
_LEVEL: Final = [(step / 10, 0.0) for step in sorted(range(-10, 11), key=abs)]
_CIRCLES: Final = [
    (radius * math.cos(turn), radius * math.sin(turn))
    for radius in (0.5, 1.0)
    for turn in np.radians([45, 90, 135, -45, -90, -135]).tolist()
]
_ANGLES: Final = np.array([*_LEVEL, *_CIRCLES])
RAYS_PER_CONE: Final = len(_ANGLES)


class SonarArray:
    """The sonars of a robot, whose cones are cast together."""

    def __init__(
        self,
        mounts: Sequence[Pose3],
        settings: Sequence[SonarSettings],
        carrier_id: int = -1,
    ) -> None:
        """Aim the rays of all cones in the body frame.

        Args:
            mounts: Pose of each sonar in the body frame.
            settings: Settings of each sonar.
            carrier_id: Id of the robot's box, which stops none of the rays; -1 for
                none.
        """
        bundles = [
            _cone(math.radians(each.beam_angle_deg)) @ mount.rotation().T
            for mount, each in zip(mounts, settings, strict=True)
        ]
        positions = np.array([mount.position() for mount in mounts])
        self._min_range = np.array([each.min_range for each in settings])
        self._max_range = np.array([each.max_range for each in settings])
        limits = np.radians([each.max_incidence_deg for each in settings])
        self._least_cosine = np.cos(limits)[:, None]
        self._aimed = Rays.uniform(
            np.repeat(positions, RAYS_PER_CONE, axis=0),
            np.concatenate(bundles),
            max_range=np.repeat(self._max_range, RAYS_PER_CONE),
            carrier_id=carrier_id,
            ray_classes=(SONAR_CLASS,),
        )

    def rays(self, body: Pose3) -> Rays:
        """Return the rays of all cones, cone by cone.

        Args:
            body: Pose of the robot's body, map frame.
        """
        rotation = body.rotation().T
        return replace(
            self._aimed,
            origins=body.position() + self._aimed.origins @ rotation,
            directions=self._aimed.directions @ rotation,
        )

    def ranges(self, traces: Traces) -> Floats:
        """Return the range of each sonar, (S,) m; the longest where nothing returned.

        Args:
            traces: The traced rays, with their angles of incidence.
        """
        found = traces.ranges.reshape(-1, RAYS_PER_CONE)
        cosine = traces.incidence.reshape(found.shape)
        returns = cosine >= self._least_cosine  # nan where nothing was hit
        # As of the original, of which only the ray on the axis ever counts.
        returns[:, 0] = True
        nearest = np.where(returns, found, np.inf).min(axis=1)
        clipped: Floats = np.clip(nearest, self._min_range, self._max_range)
        return clipped


def _cone(beam_angle: float) -> Floats:
    """Return unit vectors around the x axis, (33, 3); the first is the axis itself."""
    left, up = (_ANGLES * beam_angle / 2).T
    level = np.cos(up)
    return np.column_stack([level * np.cos(left), level * np.sin(left), np.sin(up)])
