"""Angles of incidence, against closed forms."""

import math

import numpy as np
import pytest
from parts import block

from radarsim.geometry import Floats, rotation_matrix
from radarsim.raycast.rays import Boxes, Rays
from radarsim.raycast.tracer import Tracer
from radarsim.scene import shapes
from radarsim.scene.material import Material
from radarsim.scene.scene import Part

WALL = Material("wall")
LEAF = Material("leaf", density=0.5)


def cosines(
    parts: list[Part], ray_directions: Floats, boxes: Boxes | None = None
) -> Floats:
    cast = Rays.uniform(
        np.zeros((len(ray_directions), 3)), ray_directions, max_range=80.0, power=1.0
    )
    return Tracer(parts).trace(cast, boxes, incidence=True).incidence


@pytest.mark.parametrize("yaw_deg", [0, 30, 60, 85])
@pytest.mark.parametrize("pitch_deg", [0, 45])
def test_turned_board_is_hit_at_its_angle(yaw_deg: float, pitch_deg: float) -> None:
    yaw, pitch = math.radians(yaw_deg), math.radians(pitch_deg)
    vertices, faces = shapes.box(0.001, 40, 40)
    turned = vertices @ rotation_matrix(0, pitch, yaw).T + [10, 0, 0]
    found = cosines([Part("board", WALL, turned, faces)], np.eye(3)[:1])
    assert found == pytest.approx([math.cos(yaw) * math.cos(pitch)], abs=1e-12)


def test_incidence_on_all_walls_of_a_room_matches_the_angles_behind_foliage() -> None:
    angles = np.linspace(-np.pi, np.pi, 97)[:-1] + 0.01
    ray_directions = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(96)])
    bush = block("bush", LEAF, (1, 4, 4), (3, 0, 0))
    found = cosines([block("room", WALL, (10, 10, 4), (0, 0, 0)), bush], ray_directions)
    assert found == pytest.approx(np.abs(ray_directions).max(axis=1), abs=1e-12)


def test_rays_without_a_hit_have_no_incidence() -> None:
    bush = block("bush", LEAF, (6, 4, 4), (6, 0, 0))
    ray_directions = np.array([[1.0, 0, 0], [-1, 0, 0]])
    assert np.isnan(cosines([bush], ray_directions)).all()


@pytest.mark.parametrize("yaw_deg", [0, 20, 44, 70])
def test_robots_are_hit_at_the_angles_of_their_nearer_faces(yaw_deg: float) -> None:
    yaw = math.radians(yaw_deg)
    ahead = [5.0, 0.0, yaw, -1.0, 1.0, 0.5, 0.5, 3.0]
    below = [0.0, 0.0, 0.3, -2.0, -1.0, 0.5, 0.5, 4.0]
    directions = np.array([[1.0, 0.0, 0.0], [0.2, 0.0, -1.0]])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    found = cosines([], directions, Boxes(np.array([ahead, below])))
    nearer = max(math.cos(yaw), math.sin(yaw))
    assert found == pytest.approx([nearer, -directions[1, 2]])


def test_requesting_incidence_changes_nothing_else() -> None:
    room = block("room", WALL, (10, 10, 4), (0, 0, 0))
    vertices, faces = shapes.sphere(1.0)
    ball = Part("ball", LEAF, vertices + np.array([3, 0, 0]), faces)
    angles = np.linspace(0, 6, 50)
    ray_directions = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(50)])
    cast = Rays.uniform(np.zeros((50, 3)), ray_directions, max_range=80.0, power=0.6)
    tracer = Tracer([room, ball])
    plain, asked = tracer.trace(cast), tracer.trace(cast, incidence=True)
    recorded = tracer.trace(cast, events=True, incidence=True)
    assert plain.incidence.size == 0
    for name in ("ranges", "outcomes", "parts", "power"):
        assert getattr(plain, name).tolist() == getattr(asked, name).tolist()
        assert getattr(plain, name).tolist() == getattr(recorded, name).tolist()
    assert asked.incidence == pytest.approx(recorded.incidence, nan_ok=True)
    assert set(recorded.events["ray"].tolist()) == set(range(50))


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_incidence_on_coincident_surfaces_is_that_of_the_lower_part(
    order: tuple[int, int],
) -> None:
    parts = [block(name, WALL, (1, 4, 4), (5, 0, 0)) for name in ("a", "b")]
    found = cosines([parts[i] for i in order], np.eye(3)[:1])
    assert found == pytest.approx([1.0])
