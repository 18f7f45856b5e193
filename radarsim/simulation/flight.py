"""The heights of robots that fly: how far they rise and descend, and what stops them.

A robot that flies moves level as others drive, among slices of everything solid at the
heights of its hull. Slices are made for each band of ``BAND`` m in which the bottom of
a hull can be, when a robot comes there, and the last ones are kept. A robot rises and
descends as far as vertical rays from its hull meet nothing that stops robots or light,
and the slices of the next band leave it room.
"""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from radarsim.geometry import Floats, Pose3
from radarsim.raycast.rays import Rays
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer
from radarsim.robots.fleet import Fleet
from radarsim.robots.footprint import MARGIN
from radarsim.robots.obstacles import Obstacles, slice_parts
from radarsim.robots.robot import (
    BLOCKED,
    BODY_Z,
    CLIMB,
    TOUCHED,
    UNKNOWN,
    VELOCITY_Z,
    Robot,
)
from radarsim.scene.scene import Scene
from radarsim.sensors.sonar import SONAR_CLASS

BAND: Final = 0.1  # m
MOST_BANDS: Final = 64  # that are kept: a large map has many walls at each height
HEADROOM: Final = 20.0  # m above the highest point of a map, up to which robots rise
INSET: Final = 0.01  # m from the sides of a hull to its outer rays
_GRID: Final = (-1.0, 0.0, 1.0)  # places of the rays, in half lengths and half widths


class Airspace:
    """What is at all heights of a scene.

    Attributes:
        ceiling: Height above which no robot rises, m.
    """

    def __init__(self, scene: Scene, tracer: Tracer) -> None:
        self._tracer = tracer
        self._top = float(scene.bounds[1, 2])
        self.ceiling = self._top + HEADROOM
        self._solid = [part for part in scene.parts if part.material.solid]
        self._slices: dict[int, Floats] = {}
        self._bands: dict[tuple[int, float], Obstacles] = {}

    def obstacles(self, bottom: float, height: float) -> Obstacles:
        """Return the obstacles of a hull.

        Args:
            bottom: z of its bottom, m.
            height: Its height, m.
        """
        # Above everything all bands are the same, and empty.
        band = math.floor(min(bottom, self._top + BAND) / BAND + 1e-9)
        key = band, height
        if key not in self._bands:
            last = band + math.ceil(height / BAND)
            cuts = [self._slice(number) for number in range(band, last + 1)]
            self._bands[key] = Obstacles(np.concatenate(cuts), floor=band * BAND)
            if len(self._bands) > MOST_BANDS:
                del self._bands[next(iter(self._bands))]
        return self._bands[key]

    def _slice(self, number: int) -> Floats:
        """Return the slice in the middle of a band; bands of several hulls share it."""
        if number not in self._slices:
            self._slices[number] = slice_parts(self._solid, (number + 0.5) * BAND)
            if len(self._slices) > MOST_BANDS:
                del self._slices[next(iter(self._slices))]
        return self._slices[number]

    def climb(self, fleet: Fleet, robot: Robot, boxes: Boxes, dt: float) -> None:
        """Let a robot rise or descend for a time step, as far as there is room.

        Args:
            fleet: The fleet of the robot.
            robot: A robot that flies.
            boxes: All robots.
            dt: s.
        """
        row = fleet.columns[robot.slot]
        wanted, z = row[CLIMB] * dt, row[BODY_Z]
        if wanted == 0.0:
            row[VELOCITY_Z] = 0.0
            return
        room = min(self._room(robot, wanted, boxes), self.ceiling - z)
        target = z + math.copysign(max(0.0, min(abs(wanted), room)), wanted)
        model, pose = robot.model, robot.pose
        obstacles = self.obstacles(target - model.origin_height, model.height)
        if robot.footprint.contact(pose, obstacles.segments).gap <= MARGIN:
            before = self.obstacles(z - model.origin_height, model.height)
            if obstacles is not before:
                obstacles, target = before, z
        row[VELOCITY_Z] = (target - z) / dt
        row[TOUCHED] = UNKNOWN
        row[BLOCKED] = row[BLOCKED] or abs(target - z) < abs(wanted) - 1e-9
        fleet.lift(robot, target, obstacles)

    def _room(self, robot: Robot, wanted: float, boxes: Boxes) -> float:
        """Return how far a robot can rise, or descend if that is negative, m."""
        model, body = robot.model, robot.body
        level = Pose3(body.x, body.y, body.z, yaw=body.yaw)  # as its hull stays
        above = model.height - model.origin_height
        hull = above if wanted > 0 else model.origin_height
        half = np.array([model.length, model.width]) / 2 - INSET
        places = np.array([(x, y, 0.0) for x in _GRID for y in _GRID])
        places[:, :2] *= half
        starts: Floats = places @ level.rotation().T + level.position()
        directions = np.tile([0.0, 0.0, math.copysign(1.0, wanted)], (len(starts), 1))
        reach = hull + abs(wanted)
        rays = Rays.uniform(
            starts, directions, max_range=reach, carrier_id=robot.number
        )
        rays = replace(rays, ray_classes=(SONAR_CLASS,))
        ranges = self._tracer.trace(rays, boxes).ranges
        return float(ranges.min()) - hull
