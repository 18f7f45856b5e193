"""Which way the surfaces face that the points of a scan are on."""

import math

import numpy as np
import pytest
from flat_world import box, look
from hypothesis import given
from hypothesis import strategies as st
from local_shapes import shape_around

from radarsim.autonomy.mapping.scan_matching import (
    PointMap,
    ScanPoints,
    fit,
    inward_normals,
)
from radarsim.geometry import Floats, Pose2
from radarsim.rng import generator_for


@given(yaw=st.floats(-3, 3))
def test_normals_of_a_room_point_out_of_it(yaw: float) -> None:
    scan = look(box(0, 0, 6, 4), Pose2(0.5, -0.3, yaw))
    places, along = scan.points()
    normals = inward_normals(places, along)
    assert np.hypot(*normals.T) == pytest.approx(1.0)
    c, s = math.cos(yaw), math.sin(yaw)
    on_map = places @ np.array([[c, s], [-s, c]]) + (0.5, -0.3)
    turned = normals @ np.array([[c, s], [-s, c]])
    is_east = (on_map[:, 0] > 2.999) & (np.abs(on_map[:, 1]) < 1.5)
    is_south = (on_map[:, 1] < -1.999) & (np.abs(on_map[:, 0]) < 2.5)
    assert is_east.sum() > 20 < is_south.sum()
    east, south = turned[is_east], turned[is_south]
    assert east == pytest.approx(np.broadcast_to((1.0, 0.0), east.shape), abs=1e-6)
    assert south == pytest.approx(np.broadcast_to((0.0, -1.0), south.shape), abs=1e-6)


def test_points_without_neighbours_face_along_their_beams() -> None:
    angles = np.radians([0.0, 90.0, 200.0])
    along = np.column_stack([np.cos(angles), np.sin(angles)])
    assert (inward_normals(5.0 * along, along) == along).all()
    assert inward_normals(np.zeros((0, 2)), np.zeros((0, 2))).shape == (0, 2)


def both_faces(gap: float) -> tuple[Floats, Floats]:
    """Return points on both faces of a wall along x, and their normals."""
    x = np.arange(-3.0, 3.0, 0.01)
    front = np.column_stack([x, np.zeros_like(x)])
    normals = np.repeat([[0.0, 1.0], [0.0, -1.0]], len(x), axis=0)
    return np.concatenate([front, front + np.array([0.0, gap])]), normals


def test_the_back_of_a_wall_is_not_its_front() -> None:
    known, blind = PointMap(), PointMap()
    points, normals = both_faces(0.12)
    known.add(points, normals)
    blind.add(points)
    front = shape_around(known.table, 0.0, 0.02, (0.0, 1.0))
    back = shape_around(known.table, 0.0, 0.02, (0.0, -1.0))
    assert front.dy == pytest.approx(-0.02, abs=1e-9)
    assert back.dy == pytest.approx(0.1, abs=1e-9)
    assert front.yy == pytest.approx(0.0, abs=1e-9)
    assert -0.019 < shape_around(blind.table, 0.0, 0.02).dy < 0.099
    across = shape_around(known.table, 0.0, 0.02, (1.0, 0.0))
    assert across == pytest.approx(shape_around(blind.table, 0.0, 0.02), abs=1e-9)


def test_thick_echoes_from_both_sides_of_thin_walls_leave_the_pose() -> None:
    """Four rooms around a cross of walls of 10 cm, seen by a thick beam from each."""
    cross = np.concatenate([box(0, 0, 0.1, 8), box(0, 0, 8, 0.1), box(0, 0, 8, 8)])
    rng, known = generator_for(4, "thick beam"), PointMap()

    def seen(pose: Pose2) -> ScanPoints:
        places, along = look(cross, pose).points()
        off = rng.integers(-1, 2, len(along))[:, None] * 0.1
        # A ray next to the beam ends where it meets the same wall.
        normals = np.round(inward_normals(places, along))
        turn = math.cos(pose.yaw), math.sin(pose.yaw)
        assert turn == (1.0, 0.0)
        facing = np.einsum("ij,ij->i", normals, along)
        side = np.column_stack([-along[:, 1], along[:, 0]])
        slant = np.einsum("ij,ij->i", normals, side) / np.where(facing, facing, 1.0)
        clear = np.abs(slant) < 1.5
        places = places - off * slant[:, None] * along
        places, along = places[clear], along[clear]
        return ScanPoints(places, along, inward_normals(places, along), 0.08, True)

    poses = [Pose2(x, y) for x in (-2.1, 1.8) for y in (-1.7, 2.2)]
    for pose in poses:
        for dx in np.linspace(-0.6, 0.6, 7).tolist():
            near = Pose2(pose.x + dx, pose.y - dx / 2)
            points = seen(near)
            known.add(points.places + np.array([near.x, near.y]), points.normals)
    off = []
    for pose in poses:
        for _ in range(10):
            found = fit(known.table, seen(pose), pose, pose, np.full(3, 0.1)).pose
            off.append((found.x - pose.x, found.y - pose.y))
    assert np.abs(np.mean(np.reshape(off, (4, 10, 2)), axis=1)).max() < 0.004
