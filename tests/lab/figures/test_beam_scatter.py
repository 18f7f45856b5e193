import pytest
from matplotlib.patches import FancyArrowPatch

from radarsim.lab.figures.rays import (
    RAYS,
    draw_scatter,
    returns_of,
    scatter_spec,
    take_beam,
)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_one_direction_has_a_pole_and_the_hedge_behind_it(seed: int) -> None:
    scan, rays = take_beam(scatter_spec(seed))
    pole, hedge = returns_of(scan)
    assert (pole.name, hedge.name) == ("pole_4", "hedge")
    assert pole.range == pytest.approx(15.4, abs=0.1)
    assert hedge.range == pytest.approx(23.7, abs=0.3)
    assert pole.strength > hedge.strength > 0
    assert pole.strength + hedge.strength <= 1
    assert len(rays.max_range) == RAYS


def test_strength_of_the_pole_is_the_share_of_rays_that_hit_it() -> None:
    scan, rays = take_beam(scatter_spec(0))
    pole = returns_of(scan)[0]
    across = rays.directions[:, :2]
    x, y = -0.48 - rays.origins[0, 0], 2.42 - rays.origins[0, 1]
    beside = abs(across[:, 0] * y - across[:, 1] * x)
    assert pole.strength == pytest.approx((beside < 0.12).mean(), abs=1 / RAYS)


def test_details_state_range_strength_and_time() -> None:
    drawn = draw_scatter(0)
    scan, _ = take_beam(scatter_spec(0))
    for one in returns_of(scan):
        described = f"{one.name}, {one.range:.2f} m away, gives back"
        assert f"{described} {100 * one.strength:.0f} %" in drawn.details
    assert "103 ns" in drawn.details  # 2 * 15.38 m at the speed of light
    assert "2 objects at 2 ranges" in drawn.details


def test_ways_back_lead_from_the_objects_to_the_sensor() -> None:
    drawing = draw_scatter(0).drawing
    plan, bars = drawing.axes[:2]
    scan, _ = take_beam(scatter_spec(0))
    arrows = [each for each in plan.patches if isinstance(each, FancyArrowPatch)]
    for arrow, one in zip(arrows, returns_of(scan), strict=True):
        extent = arrow.get_path().get_extents()
        assert extent.x0 == pytest.approx(0, abs=0.2)
        assert extent.x1 == pytest.approx(one.range, abs=0.2)
    assert plan.get_xlim() == bars.get_xlim()


def test_a_metre_is_as_long_along_the_beam_as_across() -> None:
    plan = draw_scatter(0).drawing.axes[0]
    box, view = plan.get_window_extent(), plan.viewLim
    assert box.width / view.width == pytest.approx(box.height / view.height)
