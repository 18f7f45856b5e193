"""Pictures of spectra: their scale in dB, and the map over them."""

import math

import numpy as np
import pytest
from fmcw_scenes import HARD, block, radar, scene_of
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from radarsim.addons.fmcw.plots import outline_pieces, plot_spectrum
from radarsim.addons.fmcw.spectrum import Spectrum
from radarsim.geometry import Pose3, rotation_matrix
from radarsim.plotting.palette import TRUTH
from radarsim.rng import generator_for
from radarsim.scene.scene import Part
from radarsim.scene.shapes import box

# A block 2 m wide whose near side is 9 m ahead of a sensor that looks along y.
SCENE = scene_of(block((2.0, 2.0, 3.0), (3.0, 14.0, 1.0)))
POSE = Pose3(3.0, 4.0, 1.0, 0.0, 0.0, math.pi / 2)


@pytest.fixture(scope="module")
def turn() -> Spectrum:
    return radar(azimuths=40).spectrum(SCENE, POSE, generator_for(0, "plot"))


def outlines(axes: Axes) -> LineCollection:
    (lines,) = (
        each
        for each in axes.findobj(LineCollection)
        if each.get_label() == "true outlines"
    )
    assert isinstance(lines, LineCollection)
    return lines


def test_outline_is_that_of_the_map_as_the_sensor_sees_it(turn: Spectrum) -> None:
    pieces = outline_pieces(turn, SCENE)
    assert np.ptp(pieces[..., 0]) == pytest.approx(2.0)
    assert pieces.min(axis=(0, 1)) == pytest.approx([9.0, -1.0])
    lengths = np.hypot(*(pieces[:, 1] - pieces[:, 0]).T)
    assert lengths.max() <= 0.1 + 1e-9
    assert lengths.sum() == pytest.approx(8.0)


def test_outline_of_what_has_corners_at_the_height_of_the_sensor(
    turn: Spectrum,
) -> None:
    vertices, faces = box(1.0, 1.0, 1.0)
    # On its edge: the middle of the box, where it has corners, is at that height.
    tilted = vertices @ rotation_matrix(0, math.pi / 4, 0).T + [3.0, 14.0, 1.0]
    scene = scene_of(
        Part("tilted", HARD, tilted, faces),
        block((1.0, 1.0, 0.5), (3.0, 10.0, 0.75)),  # its top is there
    )
    pieces = outline_pieces(turn, scene)
    assert np.hypot(*(pieces[:, 1] - pieces[:, 0]).T).max() <= 0.1 + 1e-9
    plot_spectrum(turn, scene=scene, reach=20.0)


@pytest.mark.parametrize("view", ["cartesian", "polar"])
def test_picture_has_a_scale_in_decibels(turn: Spectrum, view: str) -> None:
    figure = plot_spectrum(turn, view=view, scene=SCENE).get_figure(root=True)
    assert isinstance(figure, Figure)
    _, scale = figure.axes
    assert scale.get_ylabel().endswith(", dB")
    assert scale.get_ylim() == (-10, 50)


def test_ascope_has_an_axis_in_decibels_and_marks_surfaces(turn: Spectrum) -> None:
    axes = plot_spectrum(turn, view="ascope", scene=SCENE, reach=20.0)
    assert "dBm" in axes.get_ylabel()
    marks = [line for line in axes.lines if line.get_color() == TRUTH]
    assert [line.get_xdata()[0] for line in marks] == pytest.approx([9.0, 11.0])  # type: ignore[index]
    assert len([m for m in marks if m.get_label() == "true outlines"]) == 1


def test_map_lies_over_both_pictures(turn: Spectrum) -> None:
    above = outlines(plot_spectrum(turn, scene=SCENE, reach=20.0))
    corners = np.concatenate(above.get_segments())
    assert corners.min(axis=0) == pytest.approx([-1.0, 9.0])  # right, ahead
    unrolled = outlines(plot_spectrum(turn, view="polar", scene=SCENE, reach=20.0))
    ranges, degrees = np.concatenate(unrolled.get_segments()).T
    assert ranges.min() == pytest.approx(9.0)
    ahead = np.minimum(degrees, 360 - degrees)
    assert ahead.max() == pytest.approx(math.degrees(math.atan2(1, 9)))


def test_without_a_map_nothing_is_said_to_be_there(turn: Spectrum) -> None:
    axes = plot_spectrum(turn)
    assert not [c for c in axes.collections if isinstance(c, LineCollection)]
