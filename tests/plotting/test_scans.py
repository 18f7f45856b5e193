"""Content of a picture, read from the figure before it is painted."""

import io
import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.figure import Figure

import radarsim
from radarsim import Material, Part, Scan, Scene
from radarsim.geometry import Floats
from radarsim.plotting.marks import FULL_OPACITY, NO_RETURN_OPACITY
from radarsim.plotting.scans import plot_scans
from radarsim.plotting.sight import BeamEnd, find_sight, name_materials
from radarsim.plotting.style import FORMS, render
from radarsim.raycast.rays import EventKind
from radarsim.rng import generator_for
from radarsim.scene.shapes import box

START = (-7.7915, 0.0, 0.0)
THROUGH = "rays that see through"


def scan_of(scene: Scene, preset: str = "radar", **settings: Any) -> Scan:
    scanner = radarsim.load_sensor(preset, **settings)
    return scanner.scan(scene, START, generator_for(0, preset))


def strokes(figure: Figure, label: str = "rays") -> LineCollection:
    found = figure.axes[0].findobj(LineCollection)
    (rays,) = (lines for lines in found if lines.get_label() == label)
    assert isinstance(rays, LineCollection)
    return rays


def opacities(lines: LineCollection) -> Floats:
    return np.asarray(lines.get_edgecolor(), np.float64)[:, 3]


def hit_points(lines: LineCollection) -> Floats:
    """Give both ends of each line, (P, 2, 2) m."""
    return np.array(lines.get_segments())


def ends_of(figure: Figure) -> dict[str, Floats]:
    """Give where rays end, (R, 2) m, by how they end."""
    names = {end.name.lower() for end in BeamEnd}
    lines = {str(line.get_label()): line for line in figure.axes[0].lines}
    return {n: np.asarray(lines[n].get_xydata()) for n in names & lines.keys()}


def title(figure: Figure) -> str:
    return figure.axes[0].get_title(loc="left").replace("\n", " ")


def labels(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_rays_that_see_through_are_boldest_and_their_hits_the_largest(
    foliage_room: Scene,
) -> None:
    scan = scan_of(foliage_room, side_offset_uu=0, ray_weights=(0, 1, 0))
    figure = plot_scans(foliage_room, [scan])
    bold, others = strokes(figure, THROUGH), strokes(figure)
    assert np.min(bold.get_linewidth()) >= 2 * np.max(others.get_linewidth())
    assert np.min(opacities(bold)) > 2 * np.max(opacities(others))
    behind = int((scan.ranges * np.cos(scan.angles) + START[0] > 1.8).sum())
    assert len(ends_of(figure)["through"]) == behind > 5
    sizes = {line.get_label(): line.get_markersize() for line in figure.axes[0].lines}
    largest = sizes.pop("through")
    assert largest > max(sizes.values())
    x = hit_points(others)[:, :, 0]
    assert np.max(x) < 1.8  # no other ray is drawn behind the bushes
    assert f"{behind} see through foliage" in title(figure)


def test_rays_end_at_their_readings_and_not_behind_the_dust() -> None:
    dusty = radarsim.load_map("marulan_trial@dust")
    scanner = radarsim.load_sensor("physical")
    scan = scanner.scan(dusty, (-15.8, 0, 0), generator_for(0, "dust"))
    figure = plot_scans(dusty, [scan])
    read = np.isfinite(scan.ranges)
    assert "dust cloud" in title(figure)
    starts, farthest = np.moveaxis(hit_points(strokes(figure)), 1, 0)
    cloud = next(p for p in dusty.parts if p.material.name == "dust_cloud")
    far = cloud.vertices[:, 0].max()
    shown = opacities(strokes(figure))
    strong = shown > FULL_OPACITY * NO_RETURN_OPACITY * 1.01
    from_sensor = np.isclose(starts, (-15.8, 0)).all(axis=1)
    assert (strong & from_sensor).sum() == read.sum()
    assert np.max(farthest[strong, 0]) < far


@pytest.mark.parametrize("seed", range(2))
def test_beam_that_grazes_a_bush_and_reads_the_wall_it_touches_does_not_see_through(
    foliage_room: Scene, seed: int
) -> None:
    radar = radarsim.load_sensor("radar")
    scan = radar.scan(foliage_room, START, generator_for(seed, "radar"))
    ends = scan.cast.origins + scan.ranges[:, None] * scan.cast.directions
    behind = ends[:, 0] > 1.7  # m; where the bushes end
    assert np.array_equal(
        find_sight(foliage_room, scan).ends == BeamEnd.THROUGH, behind
    )


def test_one_bush_behind_another_is_not_seen_through() -> None:
    vertices, faces = box(0.5, 6, 6)
    parts = tuple(
        Part(
            name, Material(name, density=density), vertices + np.array([x, 0, 0]), faces
        )
        for name, density, x in (("bush", 0.2, 2.0), ("hedge", 50.0, 4.0))
    )
    scene = Scene("two", "Two", parts)
    scan = radarsim.load_sensor("radar", fov_deg=4).scan(
        scene, (0, 0, 0), generator_for(0, "x")
    )
    assert np.all(scan.ranges > 3)
    figure = plot_scans(scene, [scan])
    assert len(strokes(figure, THROUGH).get_segments()) == 0


def test_each_ray_ends_in_one_mark_that_shows_how(foliage_room: Scene) -> None:
    scan = scan_of(foliage_room, side_offset_uu=100)
    figure = plot_scans(foliage_room, [scan])
    ends = ends_of(figure)
    assert sum(map(len, ends.values())) == 181
    spent = scan.echoes.kinds == EventKind.SPENT
    assert len(ends["spent"]) == spent.sum() > 0
    true_ends = scan.cast.origins + scan.ranges[:, None] * scan.cast.directions
    assert ends["spent"] == pytest.approx(true_ends[spent, :2])
    assert "spent in foliage" in labels(figure)


@pytest.mark.parametrize("mode", ["last", "all"])
@pytest.mark.parametrize(
    "settings",
    [
        pytest.param({"side_offset_uu": 0}, id="three rays in one place"),
        pytest.param({"side_mode": "cone", "cone_rays": 1}, id="a cone of one ray"),
        pytest.param(
            {"side_mode": "cone", "cone_rays": 2, "beamwidth_az_deg": 3},
            id="a cone without a middle",
        ),
    ],
)
def test_beams_of_any_number_of_rays_can_be_drawn(
    foliage_room: Scene, mode: str, settings: dict[str, Any]
) -> None:
    scan = scan_of(foliage_room, return_mode=mode, **settings)
    axes = plot_scans(foliage_room, [scan]).axes[0]
    drawn = {str(line.get_label()) for line in axes.lines} - {"scale"}
    assert drawn or axes.findobj(PathCollection)


def test_smoke_that_stops_nothing_is_not_said_to_stop_beams(smoke_room: Scene) -> None:
    scan = scan_of(smoke_room)
    sight = find_sight(smoke_room, scan)
    through = sight.ends == BeamEnd.THROUGH
    assert np.array_equal(sight.ends == BeamEnd.TOUCHING, ~through)
    assert 0 < through.sum() < 181
    figure = plot_scans(smoke_room, [scan])
    texts = " ".join(labels(figure)).replace("\n", " ")
    assert "read what stands in or at smoke" in texts
    assert "stopped" not in title(figure)


def test_beams_of_a_laser_are_stopped_by_bushes_or_have_none_in_their_way(
    foliage_room: Scene,
) -> None:
    scan = scan_of(foliage_room, "laser")
    sight = find_sight(foliage_room, scan)
    targets = scan.echoes.targets.items()
    bushes = [part for part, target in targets if target.material == "foliage"]
    stopped = scan.echoes.beams[np.isin(scan.echoes.parts, bushes)]
    assert np.array_equal(np.flatnonzero(sight.ends == BeamEnd.STOPPED), stopped)
    assert set(sight.ends) == {BeamEnd.STOPPED, BeamEnd.FREE}
    texts = labels(plot_scans(foliage_room, [scan]))
    assert {"stopped by foliage", "reach a surface directly"} <= set(texts)


def test_noise_of_ones_own_changes_nothing_that_beams_see_through(
    smoke_room: Scene,
) -> None:
    radar = radarsim.load_sensor("radar")
    noisy = radar.with_noise(lambda ranges, rng: ranges + rng.normal(0, 0.5, 181))
    scans = [each.scan(smoke_room, (-4, 0, 0), 1) for each in (radar, noisy)]
    assert np.abs(scans[1].ranges - scans[0].ranges).max() > 1
    exact, blurred = [find_sight(smoke_room, scan) for scan in scans]
    assert np.array_equal(blurred.ends, exact.ends)


@pytest.mark.parametrize("form", FORMS)
def test_each_form_is_written_with_the_same_bytes(
    foliage_room: Scene, form: str
) -> None:
    scan = scan_of(foliage_room)
    first, second = (render(plot_scans(foliage_room, [scan]), form) for _ in range(2))
    assert first == second
    assert {"png": b"PNG", "svg": b"<svg", "pdf": b"%PDF"}[form] in first[:2000]


def test_legend_and_axes_do_not_overlap(foliage_room: Scene) -> None:
    scan = scan_of(foliage_room, return_mode="all")
    figure = plot_scans(foliage_room, [scan])
    FigureCanvasAgg(figure).print_figure(io.BytesIO())
    page, axes = figure.bbox, figure.axes[0].get_tightbbox()
    legend = figure.legends[0].get_window_extent()
    assert axes is not None
    assert axes.x1 < legend.x0
    for box_ in (axes, legend):
        assert page.x0 <= box_.x0
        assert box_.x1 <= page.x1
        assert page.y0 <= box_.y0
        assert box_.y1 <= page.y1
    rows = [text.get_window_extent() for text in figure.legends[0].get_texts()]
    for above, below in pairwise(rows):
        assert below.y1 <= above.y0 + 2  # px, of letters that reach below the line


def test_material_names_are_literal_and_limited_in_number() -> None:
    names = ["_bark", r"$\nope$", *(f"m{i}" for i in range(30))]
    vertices, faces = box(0.5, 0.5, 4)
    parts = tuple(
        Part(name, Material(name), vertices + np.array([2 + i, 3.0, 0]), faces)
        for i, name in enumerate(names)
    )
    scene = Scene(r"$\yard$", "Yard", parts)
    described = labels(plot_scans(scene, [scan_of(scene)]))
    assert "_bark" in described
    (others,) = (text for text in described if r"$\nope$" in text)
    assert "m6," in others
    assert "m7" not in others
    assert "23 more" in others
    assert render(
        plot_scans(scene, [scan_of(scene)])
    )  # mathematics would not be understood


def test_scan_without_any_return_is_drawn() -> None:
    scene = Scene("void", "Void")
    figure = plot_scans(scene, [scan_of(scene)])
    assert figure.axes[0].findobj(PathCollection) == []
    assert math.isfinite(figure.axes[0].get_xlim()[0])


@pytest.mark.parametrize("mode", ["last", "all"])
def test_beams_of_a_detector_see_through_what_their_spectrum_does(
    foliage_room: Scene, mode: str
) -> None:
    settings = {"detector": "ca", "max_range": 30, "return_mode": mode}
    scan = scan_of(foliage_room, "navtech_cts350x", **settings)
    figure = plot_scans(foliage_room, [scan])
    ahead = np.isfinite(scan.ranges) & (scan.ranges > 0) & (np.cos(scan.angles) > 0.9)
    behind = scan.ranges[ahead] * np.cos(scan.angles[ahead]) + START[0] > 2.0
    assert behind.sum() > 10
    assert len(ends_of(figure)["through"]) >= behind.sum()
    assert "stopped by foliage" in labels(figure)
    words = figure.axes[0].get_xlabel().replace("\n", " ")
    assert "farthest target of the detector 'ca'" in words


def test_pictures_of_all_sensors_have_the_same_frame(foliage_room: Scene) -> None:
    figures = [
        plot_scans(foliage_room, [scan_of(foliage_room, preset)])
        for preset in ("radar", "hokuyo")
    ]
    figures.append(plot_scans(foliage_room, [scan_of(foliage_room, "sick")] * 3))
    frames = {
        (
            *map(float, figure.get_size_inches()),
            *map(float, figure.axes[0].get_position().extents),
            *map(float, figure.axes[0].viewLim.extents),
        )
        for figure in figures
    }
    assert len(frames) == 1


@pytest.mark.parametrize("quantum", [0.0, 0.5])
def test_beams_that_answer_in_smoke_are_stopped_by_it(quantum: float) -> None:
    """The wall or the end of its power can be nearer to an answer than the edge."""
    scene = radarsim.load_map("smoke_room")
    laser = radarsim.load_sensor("physical", range_quantum=quantum)
    scan = laser.scan(scene, (-9.8, 0, 0), 1)  # where the wall is in the smoke, too
    sight = find_sight(scene, scan)
    answered = scan.ranges > 0
    assert np.unique(sight.ends[answered]).tolist() == [BeamEnd.STOPPED]
    assert name_materials(sight.materials[BeamEnd.STOPPED]) == "smoke"
