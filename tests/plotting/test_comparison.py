"""Pictures from Python: of scenes, of scans, and of several sensors side by side."""

import math
from pathlib import Path

import numpy as np
import pytest
from joint_scans import scan_together
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

import radarsim
from radarsim import Material, Scene
from radarsim.geometry import Pose3
from radarsim.plotting.marks import add_ray_rows
from radarsim.plotting.sight import BeamEnd, Sight
from radarsim.plotting.style import QUIET, Legend, render
from radarsim.raycast.tracer import tracer_of
from radarsim.sensors.scan_batch import ScanRequest


def test_map_can_be_a_name_and_the_same_seed_gives_the_same_rays() -> None:
    first, second = (radarsim.compare("foliage_room", "radar") for _ in range(2))
    ends = [
        np.concatenate([np.concatenate(c.get_segments()) for c in lines])
        for lines in (f.axes[0].findobj(LineCollection) for f in (first, second))
    ]
    assert np.array_equal(ends[0], ends[1])


def test_no_sensors_are_an_error(foliage_room: Scene) -> None:
    with pytest.raises(ValueError, match="at least one"):
        radarsim.compare(foliage_room)


@pytest.mark.parametrize(
    ("size", "columns"),
    [((60, 4), 1), ((30, 10), 2), ((20, 12), 2), ((4, 60), 2)],
    ids=["long", "wide", "room", "tall"],
)
def test_panels_leave_no_empty_bands(
    tmp_path: Path, size: tuple[int, int], columns: int
) -> None:
    path = tmp_path / "room.yaml"
    path.write_text(
        "version: 1\nobjects:\n"
        f"  - {{name: walls, box: [{size[0]}, {size[1]}, 2], material: concrete}}\n"
        "starts:\n  - {name: RobotStart1, position: [0, 0, 0]}\n"
    )
    figure = radarsim.compare(path, "radar", "laser")
    render(figure)  # which places the panels
    places = [axes.get_position() for axes in figure.axes]
    assert len({round(place.x0, 3) for place in places}) == columns
    # The plans fill the figure in one direction, but for titles and the legend.
    inches = figure.get_size_inches()
    wide = sum(place.width for place in places) * inches[0] / (3 - columns)
    tall = sum(place.height for place in places) * inches[1] / columns
    assert wide > 0.95 * inches[0] or tall > 0.75 * inches[1]
    assert inches[1] - tall < 2.2
    legends = figure.legends[0].get_window_extent()
    assert 0 <= legends.x0 < legends.x1 <= inches[0] * figure.dpi
    for axes in figure.axes:
        title = axes.get_tightbbox()
        assert title is not None
        assert title.x1 <= inches[0] * figure.dpi


def test_each_mark_has_one_row_in_the_legend_of_all_panels(empty_room: Scene) -> None:
    """Beams of the two touch other materials."""
    scan = radarsim.load_sensor("laser", fov_deg=2).scan(empty_room, (0, 0, 0))
    ends = np.full(3, BeamEnd.TOUCHING, np.uint8)
    sights = [
        Sight(ends, {BeamEnd.TOUCHING: (Material(name),)})
        for name in ("smoke", "leaves")
    ]
    figure, legend = Figure(), Legend(QUIET)
    figure.add_subplot()
    add_ray_rows(legend, [scan, scan], sights)
    legend.draw(figure)
    texts = [each.get_text().replace("\n", " ") for each in figure.legends[0].texts]
    assert texts == ["Rays", "read what stands in or at smoke and leaves"]


def test_panels_of_one_sensor_have_the_settings_that_differ() -> None:
    radars = [
        radarsim.load_sensor("radar", penetration_power=power) for power in (0.5, 40)
    ]
    figure = radarsim.compare("foliage_room", *radars, "laser")
    titles = [axes.get_title(loc="left").replace("\n", " ") for axes in figure.axes]
    assert titles[0].startswith("Radar with penetration_power 0.5, 181 beams: ")
    assert titles[1].startswith("Radar with penetration_power 40, 181 beams: ")
    assert titles[2].startswith("Laser, 181 beams: ")


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
    (scan,) = scan_together(tracer, [ScanRequest(laser, Pose3(0, 0, 1, 0, 0, 0))])
    assert scan._repr_html_() is None
    with pytest.raises(ValueError, match="has no map"):
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
