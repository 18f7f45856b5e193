"""The figures of the thesis: what their captions count, as laws."""

import runpy
import sys
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "examples" / "thesis"))

import bugs
import bushes
import calibrate_plants as calibration
import common
import dust
import mapped
import matplotlib as mpl
import noise
import numpy as np
import scatter
import side_rays
from plants import SEED, SHAPES, SHRUB, plant_files

import maps
import radarsim
from radarsim.autonomy.plans import Algorithm
from radarsim.geometry import Floats
from radarsim.plotting.sight import BeamEnd, find_sight
from radarsim.raycast.rays import Rays
from radarsim.rng import generator_for
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.scene.shapes import cylinder, sphere
from radarsim.sensors.beams import LEFT, RIGHT

ROOM = common.load_scene(common.ROOM)
AHEAD = ((-2.0, 0.0),)  # a shorter way, up to the bushes


@pytest.fixture(scope="module", autouse=True)
def _drawn_once() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for module in (bushes, dust, maps, noise, scatter, side_rays):
            patch.setattr(module, "draw", cache(module.draw))
        yield


def title_of(drawn: common.Drawn, file: str) -> str:
    return drawn[file][0].texts[0].get_text()


def test_maps_name_their_objects_and_shadows_fall_to_the_right() -> None:
    drawn = maps.draw()
    objects = maps.named_parts(common.load_scene(common.TRIAL))
    for axes in drawn["figure_01.png"][0].axes:
        names = {text.get_text() for text in axes.texts}
        assert {part.object_name.replace("_", " ") for part in objects} < names
    room, caption = drawn["figure_06.png"]
    assert caption.startswith("A wall of 7 spherical bushes, and 4 objects behind it")
    assert "through 1.43 m" in caption
    plan = room.axes[0]
    (shadows,) = (each for each in plan.collections if each.get_label() == "shadows")
    points = np.concatenate([path.vertices for path in shadows.get_paths()])
    pole = next(part for part in ROOM.parts if part.object_name == "pole")
    away = points - pole.vertices.mean(axis=0)[:2]
    away = away[(away[:, 0] > -0.2) & (np.hypot(*away.T) < 2.5)]
    assert away.max(axis=0)[0] > 1


def test_dust_blinds_the_laser_and_not_the_radar() -> None:
    for sensor in (dust.RADAR, dust.LASER):
        clear = dust.count_readings(sensor, "clear")
        assert (clear.objects, clear.cloud) == (18, 0)
        assert clear.unchanged + clear.unchanged_clear == clear.clear
    radar, laser = (dust.count_readings(name, "dust") for name in dust.NAMES)
    assert radar.unchanged == radar.crossing > 0
    assert (radar.cloud, radar.objects) == (0, 18)
    assert laser.unchanged < 0.01 * laser.crossing  # exp(-2 a 10 m) is 0.0105
    assert laser.cloud > laser.crossing
    assert laser.unchanged_clear == laser.clear - laser.crossing > 0
    assert laser.objects <= 2 + laser.unchanged  # two stand next to the dust


def test_figures_of_dust_have_the_same_limits_and_draw_all_readings() -> None:
    drawn = dust.draw()
    assert len(drawn) == 5
    limits = {axes.viewLim.bounds for each, _ in drawn.values() for axes in each.axes}
    assert len(limits) == 1
    counts = dust.count_readings(dust.LASER, "dust")
    (axes,) = drawn["figure_05.png"][0].axes
    points = {
        line.get_label(): len(np.asarray(line.get_xdata()))
        for line in axes.lines
        if str(line.get_label()).startswith("reading")
    }
    wanted = {
        "reading of an object": counts.unchanged_clear + counts.unchanged,
        "reading of the dust": counts.cloud,
    }
    assert points == wanted


def test_one_direction_has_a_pole_and_the_hedge_behind_it() -> None:
    scan, rays = scatter.take_beam()
    pole, hedge = scatter.returns_of(scan)
    assert (pole.name, hedge.name) == ("pole_4", "hedge")
    assert (pole.range, hedge.range) == pytest.approx((15.4, 23.7), abs=0.3)
    assert pole.strength > hedge.strength > 0
    # the share of rays that hit the pole, which has a radius of 0.12 m
    across = rays.directions[:, :2]
    x, y = -0.48 - rays.origins[0, 0], 2.42 - rays.origins[0, 1]
    distances = abs(across[:, 0] * y - across[:, 1] * x)
    share = (distances < 0.12).mean()
    assert pole.strength == pytest.approx(share, abs=1 / scatter.RAYS)
    drawing, caption = scatter.draw()["figure_05b.png"]
    assert "103 ns" in caption  # 2 * 15.38 m at the speed of light
    plan = drawing.axes[0]
    box, view = plan.get_window_extent(), plan.viewLim
    assert box.width / view.width == pytest.approx(box.height / view.height)


def test_the_radar_sees_through_the_bushes_and_the_hokuyo_does_not() -> None:
    drawn = bushes.draw()
    assert "0 of 228 beams" in title_of(drawn, "figure_07.png")
    assert "0 of 24624 beams end behind" in drawn["figure_07.png"][1]
    assert "15 of 181 beams" in title_of(drawn, "figure_08.png")
    names = drawn["figure_08.png"][0].texts[1].get_text()
    assert "cabinet" in names
    assert "east wall" in names
    for drawing, _ in drawn.values():
        assert (
            drawing.axes[0].viewLim.bounds
            == drawn["figure_07.png"][0].axes[0].viewLim.bounds
        )


@pytest.mark.parametrize("offset", noise.OFFSETS)
def test_beams_that_end_behind_are_those_that_see_through(offset: int) -> None:
    (scan,) = noise.radar_scans(offset)
    counts = bushes.count_ends(scan)
    assert counts.behind == (find_sight(ROOM, scan).ends == BeamEnd.THROUGH).sum()
    assert counts.inside > counts.behind > 0


def test_noise_grows_with_the_offset() -> None:
    for drawing, _ in noise.draw().values():
        titles = [axes.get_title() for axes in drawing.axes]
        none, some, many = (int(each.split(": ")[1].split()[0]) for each in titles)
        assert none == 0 < some < many
        assert len({axes.viewLim.bounds for axes in drawing.axes}) == 1
    scans = noise.radar_scans(100, 10)
    changed = np.ptp([scan.ranges for scan in scans], axis=0) > common.STEP
    assert sum(noise.count_changes(scans)) == changed.sum()
    assert min(noise.count_changes(scans)) > 0


@pytest.mark.parametrize(("offset", "apart"), [(50, 0.4), (100, 0.8)])
def test_rays_start_twice_the_offset_apart(offset: int, apart: float) -> None:
    scans = side_rays.side_scans(offset)
    assert side_rays.start_distance(scans) == pytest.approx(apart)
    for side in (LEFT, RIGHT):
        assert scans[side].cast.origins[:, 1] == pytest.approx(side * apart / 2)
    file = "figure_11.png" if offset == 50 else "figure_12.png"
    drawing, caption = side_rays.draw()[file]
    assert f"{apart:.2f} m apart" in caption
    assert f"{apart:.1f} m" in {text.get_text() for text in drawing.axes[1].texts}


@pytest.mark.slow
def test_bug1_goes_round_its_obstacle_and_bug2_does_not() -> None:
    one, two = (bugs.drive(bugs.OPEN, each) for each in bugs.LEAVING)
    assert (one.circuits, two.circuits) == (1, 0)
    assert one.monitor is not None
    assert two.monitor is not None
    assert one.monitor.path_length > two.monitor.path_length
    for run in (one, two):
        assert run.monitor is not None
        assert run.monitor.distance(run.mission.goals[-1]) < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", [Algorithm.BUG1, Algorithm.BUG2])
def test_bugs_reach_a_goal_and_find_that_there_is_no_path(algorithm: Algorithm) -> None:
    drawing, caption = bugs.draw_bug(algorithm)
    reached, failed = (axes.get_title("left") for axes in drawing.axes)
    assert "reaches its goal" in reached
    assert "no path" in failed
    assert caption.count("and 0 touches") == 2


def test_the_radar_maps_the_yard_and_the_hokuyo_nothing_of_it() -> None:
    drawing, caption = mapped.draw(AHEAD)["figure_15.png"]
    radar, laser = (axes.get_title("left") for axes in drawing.axes)
    assert int(radar.split()[0]) > 50
    assert laser == "0 % of the yard mapped with the laser"
    assert "the laser's 0.0 % of the yard behind the bushes and 0 of 4" in caption
    texts = [{text.get_text() for text in axes.texts} for axes in drawing.axes]
    assert "cabinet" in texts[0]
    assert texts[1] == {"bushes", "the yard behind the bushes", "start"}


@pytest.mark.slow
def test_hardly_anything_stays_hidden_along_the_whole_wall() -> None:
    run = mapped.explore("radar")
    assert run.share > 0.95
    assert all(cells > 3 for cells in mapped.count_object_cells(run).values())


CENTRE = np.array([3.0, -2.0, 1.0])


def rays_through_ball() -> Rays:
    return calibration.bundle(
        CENTRE, 1.0, generator_for(0, "rays"), azimuths=24, rays=400
    )


def ball_of(density: float) -> list[Part]:
    vertices, faces = sphere(1.0)
    foliage = Material("foliage", density=density)
    return [Part("ball", foliage, vertices + CENTRE, faces)]


@pytest.mark.parametrize("density", [0.1, 0.5, 1.5])
def test_transmission_of_a_ball_agrees_with_its_closed_form(density: float) -> None:
    measured = calibration.transmission(ball_of(density), rays_through_ball()).mean()
    wanted = calibration.transmission_of_ball(2 * density)
    assert measured == pytest.approx(wanted, abs=0.012)  # faces lie inside the sphere


def test_calibration_finds_a_known_density() -> None:
    rays = rays_through_ball()
    wanted = float(calibration.transmission(ball_of(0.42), rays).mean())
    found = calibration.calibrate(ball_of, wanted, rays, 5.0)
    assert found == pytest.approx(0.42, rel=2e-3)
    with pytest.raises(ValueError, match=r"expected 0\.2000 between"):
        calibration.calibrate(ball_of, 0.2, rays, 0.1)


def test_range_ends_where_the_power_is_spent() -> None:
    vertices, faces = cylinder(0.8, 4.0)
    parts = [Part("column", Material("foliage", density=1.0), vertices, faces)]
    measured = calibration.measure_plant(SHRUB, parts, offsets=101, azimuths=12)
    chords = 2 * np.sqrt(np.maximum(0.64 - measured.offsets**2, 0))
    spent = calibration.BEFORE - chords / 2 + 1
    wanted = np.where(chords > 1, spent, calibration.WALL)
    sure = np.abs(chords - 1) > 0.02  # the column has 64 sides
    assert np.abs(measured.ranges - wanted)[:, sure].max() < 5e-3


def test_finer_shapes_of_equal_transmission_scatter_more() -> None:
    shapes = list(calibration.compare_shapes(2, rays=400, azimuths=48))
    assert [each.shape for each in shapes] == list(SHAPES)
    for each in shapes:
        target = calibration.target_transmission()
        assert each.transmission == pytest.approx(target, rel=0.03)
    spreads = [each.ranges.ranges[each.ranges.spent].std() for each in shapes]
    for coarse, fine in pairwise(spreads):
        assert fine > 1.5 * coarse


def shrub_of(shape: str) -> tuple[list[Part], Floats]:
    """Return the parts of a shrub of `forest_edge`, and its crown's centre, (3,) m."""
    name = f"shrub_{shape}_1"
    parts = common.load_scene("forest_edge").parts
    y = {"ball": -11.25, "cloud": -9.75, "leaves": -8.25}[shape]
    centre = np.array([-5.0, y, 0.0]) + SHRUB.centre
    return [part for part in parts if part.object_name == name], centre


def test_shapes_of_the_hedge_have_the_same_transmission() -> None:
    means = []
    for shape in SHAPES:
        parts, centre = shrub_of(shape)
        rng = generator_for(99, "other", shape)
        rays = calibration.bundle(centre, SHRUB.crown_radius, rng)
        means.append(float(calibration.transmission(parts, rays).mean()))
    assert max(means) < 1.03 * min(means)
    assert means == pytest.approx([1 / (3 * 1.4**2)] * 3, rel=0.03)


def test_shipped_map_has_the_calibrated_losses(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(sys, "argv", ["calibrate_plants.py", str(tmp_path), "100"])
    calibration.main()
    for name, content in plant_files(SEED).items():
        assert (tmp_path / name).read_bytes() == content
    assert (tmp_path / "shrub_shapes.png").read_bytes().startswith(b"\x89PNG")
    losses = {
        words[0].strip(","): float(words[words.index("takes") + 1].strip(":"))
        for words in map(str.split, capsys.readouterr().out.splitlines()[1:])
    }
    parts = radarsim.load_map("forest_edge").parts
    materials = {part.material.name: part.material for part in parts}
    for shape, loss in losses.items():
        foliage = materials[f"foliage_{shape}"]
        shipped = foliage.sheet_loss or foliage.density
        assert loss == pytest.approx(shipped, rel=0.03)


def test_one_command_draws_all_figures_and_lists_them(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    drawn = {"figure_13.png": bushes.draw_hokuyo()}
    monkeypatch.setattr(bugs, "draw", lambda: drawn)  # not whole drives
    monkeypatch.setattr(mapped, "draw", dict)
    monkeypatch.setitem(mpl.rcParams, "savefig.dpi", 20)
    monkeypatch.setattr(sys, "argv", ["draw_all.py", str(tmp_path / "out")])
    runpy.run_path(str(Path(common.__file__).parent / "draw_all.py"))
    pictures = sorted(path.name for path in (tmp_path / "out").glob("*.png"))
    assert len(pictures) == 15
    index = (tmp_path / "out" / "index.md").read_text(encoding="utf-8")
    assert [
        line[4:-1] for line in index.splitlines() if line.startswith("![](")
    ] == pictures
