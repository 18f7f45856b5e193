"""A robot as parts of a scene: body, deck and wheels, by the numbers of its class."""

from typing import Final

import numpy as np

from radarsim.geometry import Floats, Pose2
from radarsim.presets.robots import RobotModel
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.scene.shapes import Mesh, box, cylinder

NAME: Final = "robot"  # of the parts of a robot
HULL, DARK = Material("hull"), Material("tyre")
_TYRE_WIDTH: Final = 0.09  # m
_DECK_HEIGHT: Final = 0.03  # m
_CLEARANCE: Final = 0.06  # m between the floor and the body


def robot_parts(model: RobotModel, pose: Pose2) -> tuple[Part, ...]:
    """Return the body, the deck, the scanner and the wheels of a robot.

    Args:
        model: The robot class.
        pose: Pose of the robot on the floor, map frame.
    """
    top = 2 * model.origin_height
    inside = model.wheel_separation - _TYRE_WIDTH
    across = model.wheel_separation + _TYRE_WIDTH
    body = box(model.length, inside, top - _CLEARANCE)
    deck = box(model.length, across, _DECK_HEIGHT)
    scanner = cylinder(_TYRE_WIDTH, model.height - top)
    ahead = model.items_of("RangeScanner")[0].mount.x
    pieces: list[tuple[Material, Mesh, tuple[float, float, float]]] = [
        (HULL, body, (0.0, 0.0, (top + _CLEARANCE) / 2)),
        (DARK, deck, (0.0, 0.0, top + _DECK_HEIGHT / 2)),
        (HULL, scanner, (ahead - _TYRE_WIDTH, 0.0, (top + model.height) / 2)),
    ]
    ends = (-1, 1)
    pieces += [
        (
            DARK,
            _wheel(model.wheel_radius),
            (
                fore * model.wheel_base / 2,
                side * model.wheel_separation / 2,
                model.wheel_radius,
            ),
        )
        for fore in ends
        for side in ends
    ]
    return tuple(
        Part(NAME, material, _placed(vertices + np.array(place), pose), faces)
        for material, (vertices, faces), place in pieces
    )


def _wheel(radius: float) -> Mesh:
    """Create a cylinder around the y axis."""
    vertices, faces = cylinder(radius, _TYRE_WIDTH)
    x, y, z = vertices.T
    return np.column_stack([x, -z, y]), faces


def _placed(vertices: Floats, pose: Pose2) -> Floats:
    c, s = np.cos(pose.yaw), np.sin(pose.yaw)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])  # of rows
    return np.asarray(vertices @ turn + np.array([pose.x, pose.y, 0.0]))
