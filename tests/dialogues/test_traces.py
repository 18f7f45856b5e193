"""Trails that clients let their robots leave, in the pictures of cameras."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from wire import Wire

from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.scene.scene import Scene
from radarsim.server.camera import Renderer
from radarsim.server.views import View, tiles_of


@pytest.fixture(scope="module")
def renderer(empty_room: Scene) -> Renderer:
    return Renderer(empty_room)


def coloured(
    renderer: Renderer, wire: Wire, colour: tuple[int, int, int]
) -> NDArray[np.bool_]:
    """Return which pixels of what the robot sees are of a colour, (H, W)."""
    simulation = wire.host.simulation
    (view,) = tiles_of(simulation, (simulation.vehicles[0].number, None))
    assert isinstance(view, View)
    found: NDArray[np.bool_] = (renderer.render(view) == colour).all(axis=2)
    return found


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
def test_student_sees_the_trail_of_the_robot(
    empty_room: Scene, renderer: Renderer, dialect: Dialect
) -> None:
    wire = Wire(empty_room, dialect)
    wire.send("INIT {ClassName USARBot.P3AT} {Location 0,0,0}")
    # As a student's client writes it.
    assert wire.send("Trace {On True} {Interval 0.5} {Color Green}") == []
    wire.send("DRIVE {Left -1} {Right -1}")
    wire.wait(9.99)
    green = coloured(renderer, wire, (0, 255, 0))
    marks = wire.host.simulation.trails.marks
    assert len(marks) == 20
    # They are straight ahead on the floor, the nearer ones lower and larger.
    rows, columns = np.nonzero(green)
    assert abs(columns.mean() - 79.5) < 1
    assert rows.min() > 60
    wire.send("Trace {On true} {Interval 0} {Color blue}", "DRIVE {Left 0} {Right 0}")
    wire.wait(5)
    marks = wire.host.simulation.trails.marks
    assert len(marks) == 200  # the latest, one in a tick
    assert marks[:, 3:].tolist() == [[0, 0, 1]] * 200
    wire.send("TRACE {On false}")
    assert not coloured(renderer, wire, (0, 255, 0)).any()
    assert len(wire.host.simulation.trails.marks) == 0
    assert wire.news == []


def test_walls_and_robots_hide_trails(empty_room: Scene, renderer: Renderer) -> None:
    wire = Wire(empty_room)
    wire.send("INIT {ClassName USARBot.P3AT} {Location 0,0,0}", "TRACE {On 1}")
    assert len(wire.host.simulation.trails.marks) == 0
    wire.send("TRACE {On true} {Color Purple}")
    wire.wait(1)
    wire.send("DRIVE {Left -8} {Right -8}")
    wire.wait(3)
    purple = coloured(renderer, wire, (128, 0, 128))
    assert purple.any()
    number = wire.host.connect()
    wire.host.receive(number, b"INIT {ClassName USARBot.P3AT} {Location -1.2,0,0}\r\n")
    assert coloured(renderer, wire, (128, 0, 128)).sum() < purple.sum()
    wire.host.disconnect(wire.number)
    assert len(wire.host.simulation.trails.marks) == 0


@pytest.mark.parametrize(
    ("line", "news"),
    [
        (
            "TRACE {On true} {Color Pink}",
            "TRACE Color: 'Pink', expected one of ['Red', ",
        ),
        ("TRACE {On true} {Interval x}", "TRACE Interval: 'x', expected a number"),
        ("TRACE {On true} {Size 3}", "TRACE field 'Size', expected one of"),
    ],
)
def test_what_is_no_trace_is_logged(empty_room: Scene, line: str, news: str) -> None:
    wire = Wire(empty_room)
    wire.send("TRACE {On true}", "INIT {ClassName USARBot.P3AT}", line)
    assert wire.news[0] == "TRACE without a robot, expected INIT"
    assert wire.news[1].startswith(news)


def test_marks_are_the_pixels_around_where_they_are(
    empty_room: Scene, renderer: Renderer
) -> None:
    wire = Wire(empty_room)
    wire.send("INIT {ClassName USARBot.P3AT} {Location 0,0,0}")
    (view,) = tiles_of(
        wire.host.simulation, (wire.host.simulation.vehicles[0].number, None)
    )
    assert isinstance(view, View)
    # Half behind each edge of the picture, outside of it, and in front of all of it.
    ahead, focal = 0.5, 80 / np.tan(view.fov / 2)
    places = [(80, 0), (-80, 0), (0, 60), (0, -60), (90, 0), (0, 900), (3, 7)]
    camera = view.camera.position()
    for left, up in places:
        place = camera + ahead * np.array([1.0, left / focal, up / focal])
        mark = np.array([[*place, 1.0, 0.0, 0.0]])
        red = (renderer.render(replace(view, marks=mark)) == (255, 0, 0)).all(axis=2)
        rows, columns = np.mgrid[:120, :160]
        offsets = np.hypot(columns - (79.5 - left), rows - (59.5 - up))
        assert (red == (offsets <= focal * 0.04 / ahead)).all()
    x, y, z = camera.tolist()
    near = np.array([[x + 0.041, y, z, 1.0, 0.0, 0.0]])
    red = (renderer.render(replace(view, marks=near)) == (255, 0, 0)).all(axis=2)
    assert red.sum() > 10_000
