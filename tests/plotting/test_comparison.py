"""Pictures from Python: of scenes, of scans, and of several sensors side by side."""

import math
import subprocess
import sys

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

import radarsim
from radarsim import Material, Scene
from radarsim.geometry import Pose3
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.sensors.scanning import ScanRequest, scan_batch

PLACE = (-8.0, 0.0, 0.0)


def test_panels_have_the_same_limits_and_one_legend(foliage_room: Scene) -> None:
    figure = radarsim.compare(foliage_room, "laser", "radar", start="robotstart2")
    first, second = figure.axes
    assert first.get_xlim() == second.get_xlim()
    assert first.get_ylim() == second.get_ylim()
    (legend,) = figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert len(texts) == len(set(texts))
    assert {"foliage", "see through foliage"} <= set(texts)


def test_each_panel_says_what_its_sensor_sees(foliage_room: Scene) -> None:
    far = radarsim.load_sensor("hokuyo", max_range=80)
    figure = radarsim.compare(foliage_room, far, "radar")
    laser, radar = (axes.get_title(loc="left") for axes in figure.axes)
    assert "see through" not in laser
    assert "see through foliage" in radar


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


def test_scene_is_drawn_with_names_and_starts(foliage_room: Scene) -> None:
    axes = foliage_room.plot()
    texts = {text.get_text() for text in axes.texts}
    assert {"bushes", "crate low", "cabinet", "RobotStart1"} <= texts
    assert "bush 1" not in texts
    assert not any("wall" in text for text in texts)
    assert "16 objects" in axes.get_title(loc="left")


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


def test_reprs_are_short_lines(foliage_room: Scene) -> None:
    radar = radarsim.load_sensor("radar")
    scan = radar.scan(foliage_room, PLACE, generator_for(0, "repr"))
    part = foliage_room.parts[0]
    for value in (foliage_room, part, radar, scan, part.material):
        text = repr(value)
        assert len(text) < 100
        assert "\n" not in text
        assert type(value).__name__ in text
    assert "foliage_room" in repr(foliage_room)
    assert "181 beams" in repr(scan)


def test_repr_of_a_material_makes_it_again() -> None:
    smoke = Material("smoke", density=0.0, laser_density=0.5, solid=False)
    assert repr(smoke) == (
        "Material('smoke', density=0.0, laser_density=0.5, solid=False)"
    )
    assert repr(Material("wall")) == "Material('wall')"


def test_matplotlib_waits_for_the_first_picture() -> None:
    code = (
        "import sys, radarsim; scene = radarsim.load_map('empty_room');"
        "repr(scene); sys.exit('matplotlib' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
