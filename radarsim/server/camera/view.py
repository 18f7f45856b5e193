"""Where the camera is, apart from what draws its pictures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from radarsim.geometry import Pose3
from radarsim.presets.robots import load_robot

if TYPE_CHECKING:
    from radarsim.raycast.robot_boxes import Boxes
    from radarsim.simulation.simulation import Simulation

MOUNT: Final = Pose3(0.1005, 0.0, 0.42)  # of the original's camera on a P3AT


@dataclass(frozen=True, slots=True)
class View:
    """Where a camera is, and where the robots are.

    Attributes:
        camera: Pose of the camera, map frame; it looks along its x axis.
        boxes: The robots.
        carrier_id: Id of the box of the robot that carries the camera; -1 for none.
    """

    camera: Pose3
    boxes: Boxes
    carrier_id: int = -1

    @classmethod
    def of(cls, simulation: Simulation) -> View:
        """Return the view of the robot that has been in a simulation for longest.

        Without robots it is that of a P3AT at the first start of the map.
        """
        boxes, vehicles = simulation.boxes(), simulation.vehicles
        if vehicles:
            first = vehicles[0]
            return cls(first.robot.body.compose(MOUNT), boxes, first.number)
        starts = simulation.scene.starts
        start = starts[0].pose if starts else Pose3(0.0, 0.0, 0.0)
        body = start.compose(Pose3(0.0, 0.0, load_robot("P3AT").origin_height))
        return cls(body.compose(MOUNT), boxes)
