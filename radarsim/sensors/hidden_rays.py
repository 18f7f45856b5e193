"""Side rays that start behind a wall: a sensor cannot see from there."""

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.raycast.aimed_rays import AimedRays
from radarsim.raycast.attenuation import Outcome
from radarsim.raycast.rays import Rays
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer
from radarsim.sensors.beams import BeamPattern

MIDDLE_NODE: Final = 1  # of three


class SensorPlaces(NamedTuple):
    """Where J sensors of one medium are.

    Attributes:
        tracer: Tracer of the scene.
        boxes: Boxes of the robots.
        medium: ``RADAR`` or ``LASER``.
        poses: (J, 6) x, y, z, roll, pitch, yaw, map frame.
        carrier_ids: (J,) the box that carries each; -1 for none.
    """

    tracer: Tracer
    boxes: Boxes | None
    medium: int
    poses: Floats
    carrier_ids: NDArray[np.int64]


def centre_hidden_rays(
    places: SensorPlaces, pattern: BeamPattern, aimed: AimedRays
) -> None:
    """Replace side rays that start behind an opaque surface by the centre ray.

    Args:
        places: J sensors.
        pattern: The beams of all of them.
        aimed: Their rays, to be changed.
    """
    hidden = _are_hidden(places, aimed.origins)
    nodes = np.where(hidden, MIDDLE_NODE, aimed.nodes).astype(np.int16)
    centred = pattern.aim_nodes(places.poses, nodes)
    aimed.nodes[:] = centred.nodes
    aimed.sides[:] = centred.sides
    aimed.origins[:] = centred.origins
    aimed.directions[:] = centred.directions


def _are_hidden(places: SensorPlaces, starts: Floats) -> NDArray[np.bool_]:
    """Return which rays start behind an opaque surface, seen from their sensor.

    Args:
        places: J sensors.
        starts: (J * M, 3) m, map frame, the starts of their rays.
    """
    each = len(starts) // len(places.poses)
    positions = np.repeat(places.poses[:, :3], each, axis=0)
    offset = starts - positions
    length = np.linalg.norm(offset, axis=1)
    moved = np.flatnonzero(length > 0)
    to_starts = replace(
        Rays.uniform(
            positions[moved],
            offset[moved] / length[moved, None],
            max_range=0.0,
            medium=places.medium,
        ),
        max_range=length[moved],
        carrier_id=np.repeat(places.carrier_ids, each)[moved],
    )
    traces = places.tracer.trace(to_starts, places.boxes)
    hidden = np.zeros(len(starts), np.bool_)
    hidden[moved] = traces.outcomes != Outcome.NOTHING
    return hidden
