"""Pictures from Python: of scenes, of scans, and of several sensors side by side."""

import math

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

import radarsim
from radarsim import Material, Scene
from radarsim.geometry import Pose3
from radarsim.raycast.tracer import tracer_of
from radarsim.sensors.scan_batch import ScanRequest, scan_batch


def test_map_can_be_a_name_and_the_same_seed_gives_the_same_rays() -> None:
    first, second = (radarsim.compare("foliage_room", "radar") for _ in range(2))
    ends = [
        np.concatenate([np.concatenate(c.get_segments()) for c in lines])
        for lines in (f.axes[0].findobj(LineCollection) for f in (first, second))
    ]
    assert np.array_equal(ends[0], ends[1])


@pytest.mark.parametrize(
    ("sensors", "start", "text"),
    [
        pytest.param((), None, "at least one", id="no sensor"),
        pytest.param(("radar",), "home", "RobotStart1", id="no such start"),
    ],
)
def test_wrong_arguments_say_what_is_expected(
    foliage_room: Scene, sensors: tuple[str, ...], start: str | None, text: str
) -> None:
    with pytest.raises(ValueError, match=text):
        radarsim.compare(foliage_room, *sensors, start=start)


def test_scans_and_scenes_are_drawn_into_axes_of_the_caller(empty_room: Scene) -> None:
    figure = Figure()
    left, right = figure.subplots(1, 2)
    scan = radarsim.load_sensor("laser").scan(empty_room, (0, 0, 0))
    assert scan.plot(left) is left
    assert empty_room.plot(ax=right) is right
    assert left.patches
    assert right.patches
    assert figure.legends == []


def test_notebooks_show_svg(empty_room: Scene) -> None:
    scan = radarsim.load_sensor("laser").scan(empty_room, (0, 0, 0))
    for html in (scan._repr_html_(), empty_room._repr_html_()):
        assert html is not None
        assert html.startswith("<svg")
        assert html.rstrip().endswith("</svg>")


def test_scan_without_a_map_has_no_picture(empty_room: Scene) -> None:
    tracer, laser = tracer_of(empty_room), radarsim.load_sensor("laser")
    (scan,) = scan_batch(tracer, [ScanRequest(laser, Pose3(0, 0, 1, 0, 0, 0))])
    assert scan._repr_html_() is None
    with pytest.raises(ValueError, match="without a map"):
        scan.plot()


def test_scene_of_nothing_is_drawn() -> None:
    axes = Scene("void", "Void").plot()
    assert all(map(math.isfinite, axes.get_xlim()))


def test_repr_of_a_material_makes_it_again() -> None:
    smoke = Material("smoke", density=0.0, laser_density=0.5, solid=False)
    assert repr(smoke) == (
        "Material('smoke', density=0.0, laser_density=0.5, solid=False)"
    )
    assert repr(Material("wall")) == "Material('wall')"
