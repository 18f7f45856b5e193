"""Selects the robot and the cameras that each image viewer sees.

A picture has one tile, or four tiles as quarters. A viewer on the same machine as a
client sees that client's robot; if clients on this machine have several robots, each
viewer sees a different one, in the order of connecting. A viewer on any other machine
sees the robot that spawned first.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol, TypeAlias

from radarsim.geometry import Floats, Pose3
from radarsim.presets.robots import load_robot

if TYPE_CHECKING:
    from radarsim.raycast.rays import Boxes
    from radarsim.simulation.simulation import Simulation
    from radarsim.simulation.vehicle import Vehicle

MOUNT: Final = Pose3(0.1005, 0.0, 0.42)  # camera mount on a P3AT in the original server
FOV_DEG: Final = 80.0  # horizontal field of view, as in the original server


@dataclass(frozen=True, slots=True)
class View:
    """The pose of a camera and the poses of the robots, at one time.

    Attributes:
        camera: Pose of the camera, map frame; it looks along its x axis.
        boxes: Boxes of the robots.
        carrier_id: Id of the box of the robot that carries the camera; -1 for none.
        fov: Horizontal field of view, rad.
        marks: Marks of trails, see ``Trails.marks``; None without trails.
    """

    camera: Pose3
    boxes: Boxes
    carrier_id: int = -1
    fov: float = math.radians(FOV_DEG)
    marks: Floats | None = None

    @classmethod
    def of(cls, simulation: Simulation, vehicle: Vehicle | None = None) -> View:
        """Return the view of a forward-looking camera on a robot.

        Args:
            simulation: The simulation to view.
            vehicle: The robot; None for the robot that spawned first. Without robots,
                the view is that of a P3AT at the first start of the map.
        """
        boxes, vehicles = simulation.boxes(), simulation.vehicles
        if vehicles:
            first = vehicle or vehicles[0]
            camera, marks = first.robot.body.compose(MOUNT), simulation.trails.marks
            return cls(camera, boxes, first.number, marks=marks)
        starts = simulation.scene.starts
        start = starts[0].pose if starts else Pose3(0.0, 0.0, 0.0)
        body = start.compose(Pose3(0.0, 0.0, load_robot("P3AT").origin_height))
        return cls(body.compose(MOUNT), boxes)


Tiles: TypeAlias = tuple[View | None, ...]  # one or four views; None is a black tile
Shown: TypeAlias = tuple[int, str | None]  # number of a robot, and name of a camera


class Watcher(Protocol):
    """A viewer of pictures.

    Attributes:
        robot: Number of the robot that the viewer saw last; 0 for none.
    """

    robot: int

    @property
    def address(self) -> str:
        """IP address of the viewer's machine."""
        ...


def tiles_of(simulation: Simulation, shown: Shown) -> Tiles:
    """Return the views in the tiles of a picture.

    Args:
        simulation: The simulation to view.
        shown: Number of a robot, 0 if there is none; and name of a camera of the robot,
            None for the viewports of the robot.
    """
    number, camera = shown
    vehicle = next((v for v in simulation.vehicles if v.number == number), None)
    if vehicle is None or not vehicle.cameras:
        return (View.of(simulation, vehicle),)
    names = [camera] if camera else vehicle.viewports[: 4 if vehicle.is_quad else 1]
    boxes, marks = simulation.boxes(), simulation.trails.marks
    items = {item.name: item for item in vehicle.cameras}
    return tuple(
        View(
            vehicle.camera_pose(items[name]),
            boxes,
            number,
            math.radians(vehicle.fovs[name]),
            marks,
        )
        if name in items
        else None
        for name in names
    )


def assign(simulation: Simulation, watchers: Iterable[Watcher]) -> list[Shown]:
    """Return the robot and camera that each viewer sees.

    Args:
        simulation: The simulation to view.
        watchers: The viewers in the order of connecting.
    """
    vehicles = simulation.vehicles
    present = [vehicle.number for vehicle in vehicles]
    taken: set[int] = set()
    found: list[Shown] = []
    for watcher in watchers:
        shown = simulation.shown.get(watcher.address)
        if shown is not None and shown[0] in present:
            found.append(shown)
            continue
        own = [v.number for v in vehicles if v.address == watcher.address] or present
        free = [number for number in own if number not in taken] or own
        if watcher.robot not in free:
            watcher.robot = free[0] if free else 0
        taken.add(watcher.robot)
        found.append((watcher.robot, None))
    return found
