"""Where things are drawn: on the surfaces that they came from."""

import math
from typing import Any

import numpy as np
import pytest

import radarsim
from radarsim import Material, Part, Scan, Scene
from radarsim.geometry import Pose3
from radarsim.plotting.style import echo_points, material_colours, scan_points
from radarsim.rng import generator_for
from radarsim.scene.shapes import box
from radarsim.sensors.echoes import ROBOT

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


@pytest.mark.parametrize("side_mode", ["perpendicular", "lateral", "divergent"])
@pytest.mark.parametrize("ray_choice", ["drawn", "together"])
@pytest.mark.parametrize("return_mode", ["last", "first", "strongest", "all"])
def test_echoes_of_three_rays_are_on_surfaces(
    side_mode: str, ray_choice: str, return_mode: str
) -> None:
    scan = scan_of(
        side_mode=side_mode,
        ray_choice=ray_choice,
        return_mode=return_mode,
        side_offset_uu=100,
    )
    x = echo_points(scan, scan.echoes)[:, 0]
    assert len(x) >= 9
    gap = np.abs(x[:, None] - np.array([4.0, 4.1, 6.0]))
    assert np.max(gap.min(axis=1)) < 1e-9


@pytest.mark.parametrize(
    ("preset", "settings"),
    [
        pytest.param("laser", {}, id="laser"),
        pytest.param(
            "radar",
            {
                "side_mode": "cone",
                "cone_rays": 5,
                "beamwidth_az_deg": 3,
                "ray_choice": "drawn",
                "return_mode": "all",
            },
            id="drawn from a cone",
        ),
    ],
)
def test_echoes_of_one_ray_are_on_surfaces(
    preset: str, settings: dict[str, Any]
) -> None:
    scan = scan_of(preset, **settings)
    x = echo_points(scan, scan.echoes)[:, 0]
    gap = np.abs(x[:, None] - np.array([4.0, 4.1, 6.0]))
    assert np.max(gap.min(axis=1)) < 1e-9


def test_echoes_of_a_whole_cone_are_along_its_axis() -> None:
    scan = scan_of(
        side_mode="cone",
        cone_rays=9,
        beamwidth_az_deg=3,
        beamwidth_el_deg=3,
        ray_choice="together",
        return_mode="all",
    )
    echoes = scan.echoes
    assert len(echoes) > 9 * 9
    way = echo_points(scan, echoes) - SENSOR.position()[:2]
    assert np.hypot(*way.T) == pytest.approx(echoes.ranges)
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


def test_colours_follow_the_order_of_the_map() -> None:
    names = [f"m{i}" for i in range(8)]
    materials = {name: Material(name) for name in names}
    all_of_them = material_colours(Scene("a", "A", (), (), materials))
    assert list(all_of_them) == [*names, ROBOT.name]
    assert len(set(all_of_them.values())) == 9
    fewer = material_colours(
        Scene("b", "B", (drawn(materials["m1"], 1.0),), (), materials)
    )
    assert fewer == all_of_them
    # without the list of a map, the parts tell
    assert list(material_colours(YARD)) == ["hedge", "wall", ROBOT.name]


def test_material_named_robot_keeps_its_colour() -> None:
    scene = Scene("a", "A", (), (), {ROBOT.name: ROBOT, "wall": Material("wall")})
    colours = material_colours(scene)
    assert list(colours) == [ROBOT.name, "wall"]
    assert colours[ROBOT.name] == material_colours(YARD)["hedge"]
