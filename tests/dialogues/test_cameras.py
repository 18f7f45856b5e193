"""Dialogues of clients that move cameras, and what their viewers see."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from wire import Wire

from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.scene.scene import Scene
from radarsim.server.camera import Renderer
from radarsim.server.views import View, assign, tiles_of
from radarsim.simulation.simulation import Simulation

CONFS = {
    "compat": "CONF {Type Camera} {Name Camera} {TextureOffsetX 0} {TextureOffsetY 0} "
    "{TextureResolutionX 160} {TextureResolutionY 120} {CameraDefFov 1.3963} "
    "{CameraMinFov 0.3491} {CameraMaxFov 2.0944} {CameraFov 1.3963}",
    "udk": "CONF {Type Camera} {Name Camera}{TextureOffsetX 0}{TextureOffsetY 0}"
    "{TextureResolutionX 160}{TextureResolutionY 120}{CameraDefFov 80.0000}"
    "{CameraMinFov 20.0000}{CameraMaxFov 120.0000}{CameraFov 80.0000}",
}
GEOS = {
    "compat": "GEO {Type Camera} {Name Camera Location 0.1005,0.0000,-0.4200 "
    "Orientation 0.0000,0.0000,0.0000 Mount HARD}",
    "udk": "GEO {Type Camera} {Name Camera} {Location 0.10,0.00,-0.42} "
    "{Orientation 0.00,0.00,0.00}{Mount P3AT}",
}


@dataclass
class Viewer:
    """A viewer on a machine."""

    address: str
    robot: int = 0


def view(wire: Wire, address: str = "") -> list[View | None]:
    """Return what a viewer sees."""
    simulation = wire.host.simulation
    (shown,) = assign(simulation, [Viewer(address)])
    return list(tiles_of(simulation, shown))


def only_view(wire: Wire) -> View:
    (seen,) = view(wire)
    assert seen is not None
    return seen


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
def test_usarcommander_asks_for_the_camera_of_a_p3at(
    empty_room: Scene, dialect: Dialect
) -> None:
    wire = Wire(empty_room, dialect)
    wire.send("INIT {ClassName USARBot.P3AT} {Name A} {Location 0,0,0}")
    asked = ("GETGEO {Type Camera} {Name Camera}", "GETCONF {Type Camera} {Name }")
    answers = wire.send(*asked)
    assert answers == [GEOS[dialect.name], CONFS[dialect.name]]
    assert only_view(wire).camera.position() == pytest.approx([0.1005, 0, 0.566])


@pytest.mark.parametrize("opcode", ["Zoom", "FOV", "zoom"])
@pytest.mark.parametrize(
    ("params", "degrees"), [("0.5", 28), ("0.1", 20), ("3", 120), ("0", 80), ("-1", 20)]
)
def test_zoom_is_in_whole_degrees_within_limits(
    empty_room: Scene, opcode: str, params: str, degrees: float
) -> None:
    wire = Wire(empty_room, UDK)
    wire.send("INIT {ClassName USARBot.P3AT}")
    zoom = f"SET {{Type Camera}} {{Name Camera}} {{Opcode {opcode}}}"
    (conf,) = wire.send(f"{zoom} {{Params {params}}}", "GETCONF {Type Camera}")
    assert conf.endswith(f"{{CameraFov {degrees:.4f}}}")
    assert math.degrees(only_view(wire).fov) == pytest.approx(degrees)
    # Without parameters, as a driver of Player and a student's client end up.
    (conf,) = wire.send(f"{zoom} {{0.700000}}", "GETCONF {Type Camera}")
    assert conf.endswith("{CameraFov 80.0000}")
    (conf,) = wire.send("SET {Type Camera} {FOV 1}", "GETCONF {Type Camera}")
    assert conf.endswith("{CameraFov 57.0000}")


def test_zoomed_pictures_show_the_middle_larger(empty_room: Scene) -> None:
    simulation = Simulation(empty_room)
    vehicle = simulation.spawn("A", load_robot("P3AT"), Pose2(0, 0))
    assert vehicle is not None
    renderer = Renderer(empty_room, 161, 121)
    rows = []
    for angle in (80.0, 40.0):
        vehicle.zoom(vehicle.cameras[0], angle)
        (seen,) = tiles_of(simulation, (vehicle.number, None))
        assert seen is not None
        column = renderer.render(seen).astype(int)[:, 80]
        rows.append((abs(column - column[60]).sum(axis=1) < 40).sum())
    # The wall ahead, 3 m high and 10.4 m away, fills more rows by the same factor.
    factor = math.tan(math.radians(40)) / math.tan(math.radians(20))
    assert rows[1] / rows[0] == pytest.approx(factor, rel=0.1)


class UsPtz:
    """Player's us_ptz: what it sends and reads, by its source."""

    name, camera = "CameraPanTilt", "Camera"

    def command(self, pan: float, tilt: float, zoom: float) -> list[str]:
        package = f"{{Name {self.name}}} {{Rotation 0,{-pan:f},{tilt:f}}} {{Order 0}}"
        opcode = f"{{Name {self.camera}}} {{Opcode Zoom}} {{{zoom:f}}}"
        return [f"MISPKG {package}", f"SET {{Type Camera}} {opcode}"]

    def asked(self) -> list[str]:
        kinds = ("GETCONF", "GETGEO")
        return [f"{kind} {{Type Camera}} {{Name {self.camera}}}" for kind in kinds]

    def zoom(self, line: str) -> float:
        name, field = line.split("{Name ")[1], line.split("{CameraDefFov ")[1]
        assert self.camera in name.split("}")[0]
        return float(field.split("}")[0])


def test_player_pans_tilts_and_reads_the_camera_for_a_while(empty_room: Scene) -> None:
    wire, ptz = Wire(empty_room), UsPtz()
    wire.send("INIT {ClassName USARBot.P2AT} {Name p2} {Location 0 0 0}")
    zooms = []
    for second in range(20):
        pan, tilt = 0.5 * math.sin(second / 10), 0.1
        wire.send(*ptz.command(pan, tilt, 0.7))
        answers = wire.send(*ptz.asked())
        zooms += [ptz.zoom(line) for line in answers if line.startswith("CONF")]
        wire.wait(0.98)
        if second > 5:
            # The camera follows at 0.17 rad/s: to the left and up are positive.
            seen = only_view(wire).camera
            assert seen.yaw == pytest.approx(pan, abs=0.01)
            assert -seen.pitch == pytest.approx(tilt, abs=0.01)
            assert seen.roll == pytest.approx(0.0, abs=1e-9)
    assert zooms == [pytest.approx(math.radians(80), abs=1e-4)] * 20
    known = "['Type', 'Name', 'Opcode', 'Params', 'FOV']"
    assert wire.news == [f"SET field '0.700000', expected one of {known}"] * 20


@pytest.mark.parametrize("class_name", ["Kenaf", "Talon", "TeleMax", "Rugbot", "P2AT"])
def test_camera_looks_where_its_links_point(empty_room: Scene, class_name: str) -> None:
    wire = Wire(empty_room)
    wire.send(f"INIT {{ClassName USARBot.{class_name}}} {{Location 0,0,0}}")
    ahead = only_view(wire).camera
    assert ahead.rotation() == pytest.approx(np.eye(3), abs=1e-12)
    # Iridium sends numbers of two decimals, and UsarCommander no order.
    wire.send("ACT {Name CameraPanTilt} {Link 1} {Value 1.57} {Link 2} {Value 0.30}")
    wire.wait(10)
    seen = only_view(wire).camera
    assert seen.rotation()[:, 0] == pytest.approx(
        [math.cos(1.57) * math.cos(0.3), math.sin(1.57) * math.cos(0.3), math.sin(0.3)]
    )
    height = 0.0599  # of the joint that tilts above the one that pans
    assert seen.position() == pytest.approx(ahead.position())
    assert ahead.z - height == pytest.approx(wire.body.z + 0.2036)


def test_camera_of_a_class_of_ones_own_needs_its_package() -> None:
    camera = {"type": "Camera", "name": "Eye", "parent": "Mast"}
    body = load_robot("P3AT").model_dump(exclude_unset=True)
    items = [*body["items"], camera]
    with pytest.raises(ValueError, match="parent of Eye: 'Mast', expected one of"):
        type(load_robot("P3AT")).model_validate(body | {"items": items})


TWO = """\
based_on: P3AT
name: Two
items: [{type: Camera, name: Camera2, position: [0, 0, 0.3], rotation_deg: [0, 90, 0]}]
"""


@pytest.fixture
def two_cameras(empty_room: Scene, tmp_path_factory: pytest.TempPathFactory) -> Wire:
    from radarsim.presets.robots import read_robot

    file = tmp_path_factory.mktemp("robots") / "two.yaml"
    file.write_text(TWO)
    wire = Wire(empty_room, COMPAT, read_robot(file))
    wire.send("INIT {ClassName USARBot.Two} {Name ARDrone} {Location 0,0,0}")
    return wire


def is_down(tile: View | None) -> bool | None:
    """Return whether a camera looks down; None without a camera."""
    return None if tile is None else bool(tile.camera.rotation()[2, 0] < -0.99)


def test_viewports_show_the_cameras_that_a_drone_and_the_toolbox_choose(
    two_cameras: Wire,
) -> None:
    wire = two_cameras
    assert [is_down(tile) for tile in view(wire)] == [False, True, None, None]
    (conf,) = wire.send("GETCONF {Type Camera} {Name Camera2}")
    assert "{TextureOffsetX 160} {TextureOffsetY 0} {TextureResolutionX 160}" in conf
    wire.send("SET {Type Viewports} {Config SingleView} {Viewport1 Camera2}")
    assert [is_down(tile) for tile in view(wire)] == [True]
    (conf,) = wire.send("GETCONF {Type Camera} {Name Camera2}")
    assert "{TextureOffsetX 0} {TextureOffsetY 0}" in conf
    wire.send(
        "SET {Type Viewports} {Config 1} {Viewport1 camera} {Viewport2 Disable} "
        "{Viewport4 CAMERA2}"
    )
    assert [is_down(tile) for tile in view(wire)] == [False, None, None, True]
    wire.send("SET {Type Viewports} {Config QuadView}")
    assert [is_down(tile) for tile in view(wire)] == [False, None, None, True]
    wire.send("SET {Type Viewports} {Viewport2 Camera}")
    assert [is_down(tile) for tile in view(wire)] == [False, False, None, True]
    wire.send("SET {Type Viewports} {Viewport2 Disable}")
    assert wire.news == []
    wire.send("SET {Type Viewports} {Viewport1 Eye}", "SET {Type Viewports} {Config 2}")
    assert wire.news == [
        "SET Viewport1 'Eye', expected one of ['Camera', 'Camera2', 'Disable']",
        "Config '2', expected one of ['singleview', 'quadview', '0', '1']",
    ]
    assert [is_down(tile) for tile in view(wire)] == [False, None, None, True]
    pixels = Renderer(wire.host.scene).render_tiles(tuple(view(wire)))
    assert pixels.shape == (240, 320, 3)
    assert pixels[:120, 160:].max() == 0
    assert pixels[120:, 160:].min() > 0


def test_set_camera_shows_a_robot_to_a_machine_until_it_is_released(
    two_cameras: Wire,
) -> None:
    wire = two_cameras
    wire.send("SET {Type Camera} {Robot ardrone} {Name Camera2} {Client 10.0.0.2}")
    assert [is_down(tile) for tile in view(wire, "10.0.0.2")] == [True]
    assert len(view(wire, "10.0.0.3")) == 4
    wire.send("SET {Type Camera} {Robot ARDrone} {Client 10.0.0.2}")
    assert len(view(wire, "10.0.0.2")) == 4
    wire.send("SET {Type Camera} {Client 10.0.0.2}")
    assert wire.host.simulation.shown == {}
    assert wire.news == []
    wire.send(
        "SET {Type Camera} {Robot R7} {Client 10.0.0.2}",
        "SET {Type Camera} {Robot ARDrone} {Name Eye} {Client 10.0.0.2}",
    )
    assert wire.news == [
        "SET Camera of robot 'R7', which is not there",
        "SET of Camera 'Eye', expected one of ['Camera', 'Camera2']",
    ]
    for number in range(70):
        wire.send(f"SET {{Type Camera}} {{Robot ARDrone}} {{Client {number}}}")
    assert list(wire.host.simulation.shown) == [str(n) for n in range(6, 70)]


def test_camera_commands_to_what_is_no_camera_are_logged(empty_room: Scene) -> None:
    wire = Wire(empty_room)
    wire.send(
        "SET {Type Camera} {Robot R1} {Client 10.0.0.2}",
        "SET {Type Viewports} {Config 0}",
        "INIT {ClassName USARBot.P2DX}",
        "GETCONF {Type Camera}",
        "SET {Type RangeScanner} {Opcode FOV} {Params 1}",
        "SET {Type Viewports} {Viewport1 Camera}",
    )
    assert [text[:59] for text in wire.news] == [
        "SET Camera of robot 'R1', which is not there",
        "SET without a robot, expected INIT",
        "GETCONF of type 'Camera', expected one of ['Robot', 'Ground",
        "SET FOV of type 'RangeScanner', expected Camera",
        "SET Viewport1 'Camera', expected one of ['Disable']",
    ]
    assert only_view(wire).camera.position() == pytest.approx([0.1005, 0, 0.54])


def test_viewers_see_the_robots_of_their_machine_in_the_order_of_connecting(
    empty_room: Scene,
) -> None:
    simulation = Simulation(empty_room)
    viewers = [Viewer("a"), Viewer("b"), Viewer("a"), Viewer("c"), Viewer("a")]

    def seen() -> list[int]:
        return [number for number, _ in assign(simulation, viewers)]

    def spawn(address: str, x: float) -> int:
        vehicle = simulation.spawn("R", load_robot("P3AT"), Pose2(x, 0))
        assert vehicle is not None
        vehicle.address = address
        return vehicle.number

    assert seen() == [0] * 5
    first = spawn("a", 0)
    assert seen() == [first] * 5
    second, third = spawn("a", 2), spawn("b", 4)
    assert seen() == [first, third, second, first, first]
    viewers.pop(0)
    assert seen()[:2] == [third, second]
    simulation.remove(simulation.vehicles[1])
    assert seen() == [third, first, first, first]
    (tile,) = tiles_of(simulation, (0, None))
    assert tile is not None
    assert tile.carrier_id == first
