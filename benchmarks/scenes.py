"""Scenes of the benchmarks, generated from a few numbers, and the hall of robots."""

import math
from pathlib import Path
from typing import Any, Final

import numpy as np
import trimesh

from radarsim import shipped_maps
from radarsim.geometry import rotation_matrix
from radarsim.rng import generator_for
from radarsim.scene.material import Material
from radarsim.scene.meshes import read_surfaces
from radarsim.scene.scene import Part, Scene
from radarsim.scene.shapes import Mesh, box, sphere

SENSOR = (-6.0, 0.0, 0.0)  # x, y, yaw in all scenes but the hall
WALL = Material("wall")
FOLIAGE = Material("foliage", density=1.0)
LEAF = Material("leaf", density=0.0, sheet_loss=0.4)
LEAF_SPACING: Final = 2.2  # m between shrubs, which have a radius of 1 m
MESH_MAP: Final = """\
version: 1
objects: [{{name: ball, mesh: {}, material: foliage}}]
starts: [{{name: RobotStart1, position: [9, 0, 0]}}]
"""


def foliage_wall(walls: Material = WALL) -> Scene:
    """Create a room with a wall of 60 foliage spheres, 1280 triangles each.

    Neighbours overlap by 4 % of their diameters. A ray of power 1 from ``SENSOR``
    crosses 1.7 surfaces before it is spent, or through.
    """
    radii = np.random.Generator(np.random.PCG64(7)).uniform(0.48, 0.74, 60)
    places = np.cumsum([0.0, *(0.96 * (radii[1:] + radii[:-1]))])
    places -= places.mean()
    width = float(places[-1] - places[0]) + 2.0
    parts = [_placed("room", walls, box(24.0, width, 6.0), (0.0, 0.0, 2.0))]
    for i, (radius, y) in enumerate(zip(radii.tolist(), places.tolist(), strict=True)):
        parts.append(_placed(f"bush_{i}", FOLIAGE, sphere(radius), (0.0, y, 0.35)))
    return Scene("foliage_wall", "FoliageWall", tuple(parts))


def hall_of_mirrors() -> Scene:
    """Create the foliage wall in a room whose walls are mirrors."""
    return foliage_wall(Material("silver", radar_mirror=True))


def forest(trees: int = 1200) -> Scene:
    """Create a square of trees, each a trunk in a crown that hangs to the ground.

    The crowns overlap: from the middle, a ray starts in the bounds of several of them.
    """
    rng = np.random.Generator(np.random.PCG64(7))
    side = math.ceil(math.sqrt(trees))
    parts = [_placed("room", WALL, box(200.0, 200.0, 20.0), (0.0, 0.0, 9.0))]
    for i in range(trees):
        x, y = 3.0 * (np.array(divmod(i, side)) - side / 2) + rng.uniform(-0.9, 0.9, 2)
        parts.append(_placed(f"trunk_{i}", WALL, box(0.25, 0.25, 3.0), (x, y, 1.5)))
        parts.append(_placed(f"crown_{i}", FOLIAGE, sphere(1.2), (x, y, 1.3)))
    return Scene("forest", "Forest", tuple(parts))


def bumpy_room(triangles: int) -> Scene:
    """Create an opaque room whose far wall has about the given number of triangles."""
    n = max(2, round(math.sqrt(triangles / 2)))
    steps = np.linspace(-8.0, 8.0, n + 1)
    y, z = np.meshgrid(steps, steps * 0.25 + 1.0, indexing="ij")
    x = 6.0 + 0.2 * np.sin(3.0 * y) * np.cos(5.0 * z)
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    halves = ((a, a + 1, a + n + 2), (a, a + n + 2, a + n + 1))
    faces = np.concatenate([np.column_stack(half) for half in halves])
    room = _placed("room", WALL, box(20.0, 20.0, 8.0), (0.0, 0.0, 2.0))
    return Scene("bumpy", "Bumpy", (room, Part("far", WALL, vertices, faces)))


def curtains(count: int) -> Scene:
    """Create a room with thin volumes in a row; a ray crosses two surfaces of each."""
    thin = Material("thin", density=0.001)
    parts = [_placed("room", WALL, box(40.0, 40.0, 6.0), (0.0, 0.0, 2.0))]
    for i in range(count):
        place = (-4.0 + 0.5 * i, 0.0, 1.0)
        parts.append(_placed(f"curtain_{i}", thin, box(0.2, 30.0, 3.0), place))
    return Scene("curtains", "Curtains", tuple(parts))


def leafy_shrubs(triangles: int) -> Scene:
    """Create a room with a grid of shrubs, of about 15,000 triangles each.

    Each shrub has a random yaw. No two of them touch, and there is space for a sensor.
    """
    folder = shipped_maps()["forest_edge"].parent / "meshes"
    shrub = read_surfaces(folder / "shrub_leaves.glb", folder)
    count = max(1, round(triangles / sum(len(piece.faces) for piece in shrub)))
    rng = generator_for(0, "plants", "leaf scene")
    side = math.ceil(math.sqrt(count))
    length, width, height = 4.0 + LEAF_SPACING * side, LEAF_SPACING * (side + 2), 6.0
    centre = (-8.0 + length / 2, 0.0, height / 2)
    parts = [_placed("room", WALL, box(length, width, height), centre)]
    for number in range(count):
        row, column = divmod(number, side)
        y = LEAF_SPACING * (column - (side - 1) / 2)
        rotation = rotation_matrix(0.0, 0.0, rng.uniform(0, 2 * math.pi)).T
        for piece in shrub:
            material = LEAF if piece.material == "Leaves" else Material("wood")
            mesh = piece.vertices @ rotation, piece.faces
            place = (-4.0 + LEAF_SPACING * row, y, 0.0)
            parts.append(_placed(f"shrub_{number + 1}", material, mesh, place))
    return Scene("leaves", "Leaves", tuple(parts))


def _placed(
    name: str, material: Material, mesh: Mesh, place: tuple[float, float, float]
) -> Part:
    return Part(name, material, mesh[0] + np.array(place), mesh[1])


def ball(rings: int) -> Mesh:
    """Create a closed, uneven ball of 4 ``rings`` (``rings`` - 1) triangles, 2 m."""
    count = 2 * rings
    polar, azimuth = np.meshgrid(
        np.linspace(0, np.pi, rings + 1)[1:-1],
        np.arange(count) * (2 * np.pi / count),
        indexing="ij",
    )
    radius = 2 + 0.05 * np.sin(40 * polar) * np.sin(40 * azimuth)
    x, y = np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth)
    points = (radius * np.stack([x, y, np.cos(polar)])).reshape(3, -1).T
    poles = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, -2.0]])
    here = np.arange((rings - 2) * count).reshape(-1, count)
    there = np.roll(here, -1, axis=1)
    rim, last = np.arange(count), len(points) - count
    top, bottom = np.full(count, len(points)), np.full(count, len(points) + 1)
    sides: list[Any] = [
        (here, here + count, there + count),
        (here, there + count, there),
        (top, rim, np.roll(rim, -1)),
        (bottom, last + np.roll(rim, -1), last + rim),
    ]
    faces = np.vstack([np.stack(side, axis=-1).reshape(-1, 3) for side in sides])
    return np.vstack([points, poles]), faces.astype(np.int32)


def write_mesh_map(folder: Path, mesh: Mesh, suffix: str) -> Path:
    """Write a map of one mesh, and the file of the mesh; return the map's path."""
    content: Any = trimesh.Trimesh(*mesh, process=False).export(file_type=suffix)
    (folder / f"ball.{suffix}").write_bytes(content)
    path = folder / f"{suffix}.yaml"
    path.write_text(MESH_MAP.format(f"ball.{suffix}"))
    return path


POLES: Final = 11  # in a row of the hall, and rows
GAP: Final = 2.4  # m between robots, which stand on a grid, with poles between them
ROBOTS_IN_A_ROW: Final = 36


def write_hall(folder: Path, poles: int = POLES) -> Path:
    """Write the map of a hall of 90 m, with so many poles in each of as many rows."""
    boxes = [("floor", "90, 90, 0.2", "0, 0, -0.1")]
    for name, sign in (("north", ""), ("south", "-")):
        boxes.append((name, "90, 0.2, 3", f"0, {sign}45.1, 1.5"))
    for name, sign in (("east", ""), ("west", "-")):
        boxes.append((name, "0.2, 90, 3", f"{sign}45.1, 0, 1.5"))
    shapes = [(name, f"box: [{size}]", place) for name, size, place in boxes]
    for i in range(poles * poles):
        x, y = (3 * GAP * (k - (poles - 1) / 2) for k in divmod(i, poles))
        shapes.append((f"pole_{i}", "cylinder: [0.3, 2.5]", f"{x:g}, {y:g}, 1.25"))
    lines = ["version: 1", "objects:"]
    for name, shape, place in shapes:
        at = f"position: [{place}], material: concrete"
        lines.append(f"  - {{name: {name}, {shape}, {at}}}")
    lines += ["starts:", "  - {name: RobotStart1, position: [1.2, 1.2, 0]}"]
    path = folder / f"hall_{poles}.yaml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def init_line(number: int, robot_class: str = "P3AT") -> bytes:
    """Return the line that spawns a robot in the hall, at the place of its number.

    Few robots are spread over the whole hall, as many are.
    """
    # A stride without common divisor visits all places once, far apart from the start.
    place = number * 803 % ROBOTS_IN_A_ROW**2
    row, column = divmod(place, ROBOTS_IN_A_ROW)
    x, y = (GAP * (k - (ROBOTS_IN_A_ROW - 1) / 2) for k in (column, row))
    yaw = math.remainder(2.4 * number, math.tau)
    pose = f"{{Location {x:.2f},{y:.2f},0}} {{Rotation 0,0,{yaw:.4f}}}"
    return f"INIT {{ClassName {robot_class}}} {{Name R{number}}} {pose}\r\n".encode()


def drive_line(number: int) -> bytes:
    """Return the line that makes a robot drive in circles, half of them to the left."""
    left, right = (2.5, 4.0) if number % 2 else (4.0, 2.5)
    return f"DRIVE {{Left {left}}} {{Right {right}}}\r\n".encode()
