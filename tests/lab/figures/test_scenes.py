import math
import re

import numpy as np
import pytest

from radarsim.geometry import Floats, Pose2
from radarsim.lab.figures.figure import DrawnFigure, load_scene
from radarsim.lab.figures.scenes import (
    ABOVE,
    OBLIQUE,
    SUN,
    View,
    _cut,
    draw_test_map,
    draw_trial_scene,
    ground_colour,
    named_parts,
    robot_parts,
)
from radarsim.plotting.style import as_words
from radarsim.presets.robots import load_robot


@pytest.fixture(scope="module")
def trial() -> DrawnFigure:
    return draw_trial_scene(0)


def areas(corners: Floats) -> Floats:
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(np.linalg.norm(sides, axis=1) / 2)


def test_seen_from_above_x_is_right_and_y_is_up() -> None:
    point = np.array([[1.0, 2.0, 3.0]])
    assert ABOVE.project(point) == pytest.approx(point)


@pytest.mark.parametrize("azimuth", [-140.0, 0.0, 65.0])
@pytest.mark.parametrize("elevation", [5.0, 24.0, 90.0])
def test_projection_keeps_lengths_and_handedness(
    azimuth: float, elevation: float
) -> None:
    view = View(math.radians(azimuth), math.radians(elevation))
    seen = view.project(np.eye(3))
    assert seen @ seen.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(seen) == pytest.approx(1)
    assert seen[2, 1] >= -1e-12  # what is up stays up


def test_subdivided_triangles_are_small_and_cover_the_same_area() -> None:
    corners = np.array(
        [[[0, 0, 0], [40.0, 0, 0], [0, 40, 0]], [[0, 0, 1], [1, 0, 1], [0, 1, 1]]]
    )
    segments = _cut(corners)
    sides = np.linalg.norm(segments - np.roll(segments, 1, axis=1), axis=2)
    assert sides.max() <= 2
    assert areas(segments).sum() == pytest.approx(areas(corners).sum())
    assert len(_cut(segments)) == len(segments)


@pytest.mark.parametrize("name", ["marulan_trial", "foliage_room"])
def test_the_ground_is_pale(name: str) -> None:
    scene = load_scene(name)
    assert (ground_colour(scene) > 0.7).all()
    assert (ground_colour(scene) <= 1).all()


def test_trial_scene_consists_of_poles_boxes_and_plants(trial: DrawnFigure) -> None:
    counts = re.search(r"(\d+) poles, (\d+) boxes and (\d+) plants", trial.details)
    assert counts is not None
    assert sum(map(int, counts.groups())) == len(
        named_parts(load_scene("marulan_trial"))
    )
    objects = named_parts(load_scene("marulan_trial"))
    for axes in trial.drawing.axes:
        names = {text.get_text() for text in axes.texts}
        assert {as_words(part.object_name) for part in objects} < names


def test_labels_do_not_cover_other_objects(trial: DrawnFigure) -> None:
    drawing = trial.drawing
    plan = drawing.axes[1]
    drawing.draw_without_rendering()
    parts = {
        part.object_name: part for part in named_parts(load_scene("marulan_trial"))
    }
    for text in plan.texts:
        box = text.get_window_extent().transformed(plan.transData.inverted())
        assert plan.viewLim.x0 < box.x0 < box.x1 < plan.viewLim.x1
        for name, part in parts.items():
            low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
            apart = box.x1 < low[0] or box.x0 > high[0]
            apart |= box.y1 < low[1] or box.y0 > high[1]
            assert apart, (text.get_text(), name)


def test_details_of_the_test_map_names_the_hidden_objects() -> None:
    drawn = draw_test_map(0)
    details = drawn.details
    assert details.startswith("A room of 20.8 by 12.8 m. A wall of 7 spherical bushes")
    assert "behind it stand 4 things" in details
    assert "get through 1.43 m" in details
    assert "4 things behind it" in drawn.drawing.texts[0].get_text()


def test_light_comes_from_above_left_and_shadows_fall_to_the_right() -> None:
    assert SUN[0] < 0 < SUN[1]
    plan = draw_test_map(0).drawing.axes[0]
    (shadows,) = (each for each in plan.collections if each.get_label() == "shadows")
    points = np.concatenate([path.vertices for path in shadows.get_paths()])
    room = load_scene("foliage_room")
    pole = next(part for part in room.parts if part.object_name == "pole")
    middle = pole.vertices.mean(axis=0)[:2]
    away = points - middle
    tip = away[(away[:, 0] > -0.2) & (np.hypot(*away.T) < 2.5)].max(axis=0)[0]
    assert tip > 1
    assert away[np.abs(away[:, 0] - tip) < 0.05, 1].max() < 0


def test_oblique_view_has_the_orientation_of_the_plan() -> None:
    ahead, left = OBLIQUE.project(np.eye(3)[:2])[:, :2]
    assert ahead[0] > 0.9
    assert left[1] > abs(left[0])


def test_robot_is_drawn_as_large_as_its_class() -> None:
    model = load_robot("P3AT")
    parts = robot_parts(model, Pose2(1.0, 2.0, math.pi / 2))
    points = np.concatenate([part.vertices for part in parts])
    size = np.ptp(points, axis=0)
    assert size[1] == pytest.approx(model.length)
    assert size[0] == pytest.approx(model.width, abs=0.06)
    assert (points[:, 2].min(), points[:, 2].max()) == pytest.approx((0, model.height))
    on_floor = [part for part in parts if part.vertices[:, 2].min() < 1e-9]
    assert len(on_floor) == 4
