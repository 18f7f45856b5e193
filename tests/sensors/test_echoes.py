"""What the sensors know of what they see."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from joint_scans import scan_together
from parts import block

import radarsim
from radarsim import Echoes, Material, Part, Pose3, Scan, Scene
from radarsim.presets.sensors import load_settings
from radarsim.raycast.rays import Boxes
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.scene.material import library_material
from radarsim.scene.shapes import cylinder
from radarsim.sensors.scan import Target
from radarsim.sensors.scan_batch import ScanRequest

WALL = Material("wall")
LEAF = Material("leaf", density=0.4)
SMOKE = Material("smoke", density=0.0, laser_density=0.5, solid=False)
SHEET = Material("sheet", density=0.0, laser_density=0.0, sheet_loss=0.25)
STEEL = Material("steel")


def pole(name: str, x: float, y: float, radius: float = 0.1) -> Part:
    vertices, faces = cylinder(radius, 2.0)
    return Part(name, STEEL, vertices + np.array([x, y, 0.5]), faces)


def scene(*parts: Part) -> Scene:
    return Scene("yard", "Yard", parts)


def take(world: Scene, pose: Sequence[float] = (0, 0, 0), **settings: object) -> Scan:
    radar = radarsim.load_sensor("radar", fov_deg=4, resolution_deg=2, **settings)
    return radar.scan(world, pose, generator_for(1))


def objects(echoes: Echoes, beam: int) -> list[str]:
    targets = echoes.targets
    parts = echoes.parts[echoes.beams == beam].tolist()
    return [targets[part].object for part in parts]


# The left ray hits the near one, the centre ray the far one, the right ray neither.
POLES = scene(pole("near", 5, 0.15), pole("far", 8, 0.0, 0.05))


def test_two_partly_hidden_poles_are_two_echoes_of_one_beam() -> None:
    scan = take(POLES, return_mode="all", side_offset_uu=25)
    assert objects(scan.echoes, 1) == ["near", "far"]
    assert scan.echoes.ranges[scan.echoes.beams == 1] == pytest.approx(
        [5 - math.sqrt(0.01 - 0.05**2), 7.95], abs=2e-3
    )


def test_smoke_is_neither_first_nor_strongest_echo() -> None:
    world = scene(block("cloud", SMOKE, (2, 4, 4), (3, 0, 0)), pole("pole", 7, 0, 0.5))
    for mode in ("first", "strongest"):
        assert objects(take(world, return_mode=mode).echoes, 1) == ["pole"]
    every = take(world, return_mode="all", ray_choice="drawn")
    assert objects(every.echoes, 1) == ["cloud", "cloud", "pole"]


def test_targets_describe_shrub_smoke_and_wall() -> None:
    world = scene(
        block("cloud", SMOKE, (1, 4, 4), (3, 0, 0)),
        block("shrub", LEAF, (1, 4, 4), (5, 0, 0)),
        block("back", WALL, (1, 4, 4), (7, 0, 0)),
    )
    targets = take(world, return_mode="all").echoes.targets
    by_name = {target.object: target for target in targets.values()}
    assert by_name["cloud"] == Target("cloud", "smoke", 0.0, 1.0, True, True)
    assert by_name["shrub"] == Target("shrub", "leaf", 0.4, 0.6, False, False)
    assert by_name["back"] == Target("back", "wall", math.inf, 0.0, False, False)


@pytest.mark.parametrize(
    ("material", "sensor", "density", "transparency"),
    [
        (LEAF, "radar", 0.4, 0.6),
        (LEAF, "laser", math.inf, 0.0),
        (SMOKE, "laser", 0.5, 1.0),  # which smoke costs nothing
        (SMOKE, "hokuyo", 0.5, 0.0),  # which smoke blinds
        (Material("thick", density=7.0), "radar", 7.0, 0.0),
        (SHEET, "radar", 0.0, 0.75),
        (SHEET, "laser", 0.0, 1.0),
        (SMOKE, "unpowered", 0.0, 1.0),
        (LEAF, "unpowered", 0.4, 0.0),
    ],
)
def test_transparency_is_the_share_passed_by_one_metre(
    material: Material, sensor: str, density: float, transparency: float
) -> None:
    unpowered = load_settings("radar", penetration_power=0)
    settings = unpowered if sensor == "unpowered" else load_settings(sensor)
    target = Target.of("it", material, settings)
    assert target.density == density
    assert target.transparency == pytest.approx(transparency)


def test_robot_is_a_target() -> None:
    world = scene(block("wall", WALL, (1, 9, 4), (7, 0, 0)))
    radar = radarsim.load_sensor("radar", fov_deg=4, resolution_deg=2)
    tracer = tracer_of(world)
    boxes = Boxes(np.array([[3.0, 0, 0, 0, 1, 0.5, 0.5, 4.0]]))
    request = ScanRequest(radar, Pose3(0, 0, 0.3), generator_for(0))
    (scan,) = scan_together(tracer, [request], boxes)
    assert set(scan.echoes.targets.values()) == {
        Target("robot 4", "robot", math.inf, 0.0, False, False)
    }


def test_echoes_convert_to_json_types() -> None:
    world = scene(block("bush", LEAF, (1, 4, 4), (3, 0, 0)))
    scan = take(world, return_mode="all", side_offset_uu=0, ray_choice="drawn")
    first, second = scan.to_dict()["echoes"][1]
    assert first == {
        # half of its 0.99 has come back where 0.505 would come back
        "range": pytest.approx(2.5 - math.log10(0.505) / 2),
        "front": pytest.approx(2.5),
        "kind": "enter",
        "ray": first["ray"],
        "power": 1.0,
        "strength": pytest.approx(0.99),
        "decibels": pytest.approx(10 * math.log10(0.99)),
        "object": "bush",
        "material": "leaf",
        "density": 0.4,
        "transparency": pytest.approx(0.6),
        "laser_passes": False,
        "robot_passes": False,
    }
    assert (second["kind"], second["power"]) == ("leave", pytest.approx(0.6))
    assert (second["strength"], second["decibels"]) == (0.0, None)
    assert second["front"] == second["range"] == pytest.approx(3.5)
    assert first["ray"] in (-1, 0, 1)


@pytest.mark.parametrize(
    ("mode", "wanted"),
    [("first", 2.5), ("strongest", 2.5 - math.log10(0.505) / 2), ("last", 6.5)],
)
def test_each_mode_reads_a_bush_before_a_wall_at_its_range(
    mode: str, wanted: float
) -> None:
    world = scene(
        block("bush", LEAF, (1, 4, 4), (3, 0, 0)),
        block("wall", WALL, (1, 9, 4), (7, 0, 0)),
    )
    scan = take(world, return_mode=mode, side_offset_uu=0)
    assert scan.ranges[1] == pytest.approx(wanted)
    assert scan.echoes.ranges[scan.echoes.beams == 1] == pytest.approx([wanted])


def test_infinite_values_become_null() -> None:
    world = scene(block("wall", WALL, (1, 9, 4), (7, 0, 0)))
    lists = radarsim.load_sensor("laser").scan(world, (0, 0, 0)).to_dict()["echoes"]
    assert lists[0] == []
    (echo,) = lists[90]
    assert (echo["power"], echo["density"], echo["ray"]) == (None, None, None)


@pytest.mark.parametrize(
    ("sensor", "settings"),
    [("radar", {"glint_deg": 0.5}), ("hss94_marulan", {}), ("navtech_cts350x", {})],
)
def test_metal_plate_that_faces_a_radar_answers(
    sensor: str, settings: dict[str, Any]
) -> None:
    metal = library_material("metal")
    world = scene(block("plate", metal, (0.1, 3, 3), (10, 0, 0)))
    settings = {"return_mode": "all", "ray_choice": "together", **settings}
    radar = radarsim.load_sensor(sensor, **settings)
    middle = int(np.argmin(np.abs(radar.angles)))
    echoes = radar.scan(
        world, (0, 0, 0.3, 0, 0, -radar.angles[middle]), generator_for(1)
    )
    mine = echoes.echoes.beams == middle
    assert objects(echoes.echoes, middle) == ["plate"] * int(mine.sum())
    assert echoes.ranges[middle] == pytest.approx(9.95, abs=0.4)
    assert echoes.echoes.strength[mine].max() > 0.2


def test_sensors_of_the_thesis_and_lasers_see_only_what_mirrors_show() -> None:
    world = scene(block("plate", library_material("metal"), (0.1, 3, 3), (10, 0, 0)))
    for sensor in ("radar", "thesis", "laser", "sick"):
        scan = radarsim.load_sensor(sensor).scan(world, (0, 0, 0), generator_for(1))
        assert np.isinf(scan.ranges).all(), sensor


@pytest.mark.parametrize("angle_deg", [30.0, 60.0])
def test_metal_plate_that_is_turned_away_stays_dark(angle_deg: float) -> None:
    metal = library_material("metal")
    plate = block("plate", metal, (0.1, 3, 3), (10, 0, 0), angle_deg)
    assert np.isinf(take(scene(plate), glint_deg=1).ranges).all()


def test_pane_shows_itself_and_what_is_behind_it() -> None:
    """6.5 dB one way at 77 GHz: 13 dB out and back, half of it at each face."""
    pane = block("pane", library_material("glass"), (0.006, 4, 4), (4, 0, 0))
    world = scene(pane, block("wall", WALL, (1, 9, 4), (8, 0, 0)))
    settings = {"band_ghz": 77, "return_mode": "all", "side_offset_uu": 0}
    # pitched, so that it does not face the beam
    scan = take(world, (-2, 0, 0.3, 0, 0.15, 0), **settings)
    assert objects(scan.echoes, 1) == ["pane", "pane", "wall"]
    mine = scan.echoes.beams == 1
    assert scan.echoes.strength[mine][-1] == pytest.approx(10**-1.3)
    assert scan.echoes.strength[mine].sum() == pytest.approx(1.0)
