"""Where things are drawn: on the surfaces that they came from."""

import math
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

import radarsim
from radarsim import Material, Part, Scan, Scene
from radarsim.geometry import Pose2, Pose3
from radarsim.plotting.palette import colour_of
from radarsim.plotting.plan import draw_robot
from radarsim.plotting.style import draw_scale_bar, echo_points, scan_points
from radarsim.presets.robots import load_robot
from radarsim.rng import generator_for
from radarsim.scene.shapes import box
from radarsim.sensors.scan import ROBOT

SENSOR = Pose3(0.5, -0.25, 1.0, 0.0, 0.0, math.radians(20))


def drawn(material: Material, x: float) -> Part:
    """Make something thick, wide and high, with its near side at x."""
    vertices, faces = box(0.1, 60, 60)
    return Part(material.name, material, vertices + np.array([x + 0.05, 0, 0]), faces)


YARD = Scene(
    "yard",
    "Yard",
    (drawn(Material("hedge", density=0.5), 4.0), drawn(Material("wall"), 6.0)),
)


def scan_of(preset: str = "radar", **settings: Any) -> Scan:
    narrow = {"fov_deg": 40, "resolution_deg": 5, "max_range": 40, **settings}
    scanner = radarsim.load_sensor(preset, **narrow)
    return scanner.scan(YARD, SENSOR, generator_for(3, "places"))


CONE: dict[str, Any] = {"side_mode": "cone", "cone_rays": 5, "beamwidth_az_deg": 3}


@pytest.mark.parametrize(
    ("preset", "settings"),
    [
        ("laser", {}),
        ("radar", {**CONE, "ray_choice": "drawn", "return_mode": "all"}),
        *(
            ("radar", {"side_mode": mode, "ray_choice": choice, "return_mode": returns})
            for mode in ("perpendicular", "lateral", "divergent")
            for choice in ("drawn", "together")
            for returns in ("last", "all")
        ),
    ],
    ids=str,
)
def test_echoes_of_single_rays_are_on_surfaces(
    preset: str, settings: dict[str, Any]
) -> None:
    scan = scan_of(preset, side_offset_uu=100, **settings)
    x = echo_points(scan, scan.echoes)[:, 0]
    assert len(x) >= 9
    gap = np.abs(x[:, None] - np.array([4.0, 4.1, 6.0]))
    assert np.max(gap.min(axis=1)) < 1e-9


def test_echoes_of_a_whole_cone_are_along_its_axis() -> None:
    cone = {**CONE, "cone_rays": 9, "beamwidth_el_deg": 3}
    scan = scan_of(**cone, ray_choice="together", return_mode="all")
    echoes = scan.echoes
    assert len(echoes) > 9 * 9
    way = echo_points(scan, echoes) - SENSOR.position()[:2]
    assert np.hypot(*way.T) == pytest.approx(echoes.fronts)
    angles = np.arctan2(way[:, 1], way[:, 0]) - SENSOR.yaw
    assert angles == pytest.approx(scan.angles[echoes.beams])


def test_points_of_side_rays_lie_beside_the_surfaces_that_they_met() -> None:
    scan = scan_of(ray_weights=(0, 0, 1), side_mode="lateral", side_offset_uu=100)
    met, commander_image = echo_points(scan, scan.echoes), scan_points(scan)
    to_left = np.array([-math.sin(SENSOR.yaw), math.cos(SENSOR.yaw)])
    assert met - commander_image == pytest.approx(np.tile(0.4 * to_left, (9, 1)))


def test_no_return_is_placed_at_the_maximum_range() -> None:
    scan = scan_of("laser", max_range=2)
    way = scan_points(scan) - SENSOR.position()[:2]
    assert np.hypot(*way.T) == pytest.approx(np.full(9, 2.0))


def test_materials_of_one_family_have_one_colour() -> None:
    names = ["oak_leaves", "brick_wall", "hedge", "dust", "soil", "steel"]
    materials = {name: Material(name) for name in names}
    materials["oak_leaves"] = Material("oak_leaves", sheet_loss=0.1)
    colours = {name: colour_of(each) for name, each in materials.items()}
    assert colours["oak_leaves"] == colours["hedge"]
    assert len({*colours.values(), colour_of(ROBOT)}) == 5  # robots are of metal


@pytest.mark.parametrize(
    ("width", "length"), [(102.0, 20.0), (12.0, 2.0), (2.6, 0.5), (0.06, 0.01)]
)
def test_scale_bar_has_a_round_length_and_says_it(width: float, length: float) -> None:
    axes = Figure().add_subplot()
    axes.set_xlim(-3.0, -3.0 + width)
    assert draw_scale_bar(axes) == pytest.approx(length)
    (bar,) = axes.lines
    ends = np.asarray(bar.get_xdata(), np.float64)
    assert ends[1] - ends[0] == pytest.approx(length)
    assert [text.get_text() for text in axes.texts] == [f"{length:g} m"]


def test_robot_is_drawn_in_its_true_size_where_it_stands() -> None:
    axes = Figure().add_subplot()
    draw_robot(axes, "P3AT", Pose2(2.0, 1.0, math.pi / 2))
    polygons = [patch for patch in axes.patches if isinstance(patch, Polygon)]
    corners = np.concatenate([np.asarray(p.get_xy())[:, :2] for p in polygons])
    low, high = corners.min(axis=0), corners.max(axis=0)
    assert (low + high) / 2 == pytest.approx((2.0, 1.0))
    model = load_robot("P3AT")
    assert high[1] - low[1] == pytest.approx(model.length, abs=0.1)
    assert high[0] - low[0] == pytest.approx(model.width, abs=0.1)
