import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.text import Annotation

from radarsim.lab.figures.rays import (
    RAY_COLOURS,
    draw_offset_rays,
    offset_spec,
    start_distance,
)
from radarsim.sensors.beams import LEFT, RIGHT


@pytest.mark.parametrize(("offset", "apart"), [(50, 0.4), (100, 0.8)])
def test_rays_start_twice_the_offset_apart(offset: int, apart: float) -> None:
    scans = {side: offset_spec(0, offset, side).take()[0] for side in (LEFT, RIGHT)}
    assert start_distance(scans) == pytest.approx(apart)
    for side, scan in scans.items():
        assert scan.rays is not None
        assert (scan.rays == side).all()
        assert scan.cast.origins[:, 1] == pytest.approx(side * apart / 2)
    drawn = draw_offset_rays(0, offset=offset)
    assert f"{apart:.2f} m apart" in drawn.details
    assert drawn.commands == tuple(
        offset_spec(0, offset, s).command for s in (LEFT, RIGHT)
    )


def test_left_rays_are_red_and_right_rays_blue_and_the_room_shows_every_third() -> None:
    drawing = draw_offset_rays(0, offset=50).drawing
    for axes, beams in zip(drawing.axes, (61, 181), strict=True):
        (rays,) = (
            lines
            for lines in axes.collections
            if isinstance(lines, LineCollection) and lines.get_zorder() == 2
        )
        colours = np.asarray(rays.get_edgecolor(), np.float64)[:, :3]
        starts = np.array(rays.get_segments())[:, 0]
        for side in (LEFT, RIGHT):
            colour = to_rgb(RAY_COLOURS[side])
            mine = np.isclose(colours, colour).all(axis=1)
            fresh = np.isclose(starts[mine], [-7.7915, side * 0.2]).all(axis=1)
            assert fresh.sum() == beams


def test_distance_of_the_rays_is_drawn_with_arrows() -> None:
    close = draw_offset_rays(0, offset=100).drawing.axes[1]
    assert "0.8 m" in {text.get_text() for text in close.texts}
    arrows = [text.arrow_patch for text in close.texts if isinstance(text, Annotation)]
    assert [arrow is not None for arrow in arrows].count(True) == 1
    starts = [
        float(np.asarray(line.get_ydata())[0])
        for line in close.lines
        if line.get_linestyle() == "--"
    ]
    assert max(starts) - min(starts) == pytest.approx(0.8)


def test_each_figure_has_a_caption_of_its_own() -> None:
    captions = [draw_offset_rays(0, offset=offset).caption for offset in (50, 100)]
    one, two = ({*caption.split(". ")[1:]} for caption in captions)
    assert not one & two
