"""What is in a picture, asked of the figure before it is painted."""

import io
import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import to_rgb, to_rgba
from matplotlib.figure import Figure

import radarsim
from radarsim import Material, Part, Scan, Scene
from radarsim.geometry import Floats
from radarsim.plotting.palette import RADAR, Family, family_of
from radarsim.plotting.ray_segments import (
    FULL_OPACITY,
    FULL_WIDTH,
    NO_RETURN_OPACITY,
    line_opacity,
    line_width,
)
from radarsim.plotting.scans import draw_scans, plot_scans
from radarsim.plotting.sight import BeamEnd, find_sight
from radarsim.plotting.style import FORMS, area_style, scan_points
from radarsim.raycast.attenuation import EventKind
from radarsim.rng import generator_for
from radarsim.scene.shapes import box

START = (-7.7915, 0.0, 0.0)
THROUGH = "rays that see through"
STONE = Family.STONE.value


def scan_of(scene: Scene, preset: str = "radar", **settings: Any) -> Scan:
    scanner = radarsim.load_sensor(preset, **settings)
    return scanner.scan(scene, START, generator_for(0, preset))


def strokes(figure: Figure, label: str = "rays") -> LineCollection:
    found = figure.axes[0].findobj(LineCollection)
    (rays,) = (lines for lines in found if lines.get_label() == label)
    assert isinstance(rays, LineCollection)
    return rays


def colours_of(artist: LineCollection | PathCollection) -> Floats:
    """Give the colours of lines or outlines, (P, 4)."""
    return np.asarray(artist.get_edgecolor(), np.float64)


def hit_points(lines: LineCollection) -> Floats:
    """Give both ends of each line, (P, 2, 2) m."""
    return np.array(lines.get_segments())


def markers(figure: Figure) -> dict[str, PathCollection]:
    found = figure.axes[0].findobj(PathCollection)
    return {str(marks.get_label()): marks for marks in found}


def ends_of(figure: Figure) -> dict[str, Floats]:
    """Give where rays end, (R, 2) m, by how they end."""
    names = {end.name.lower() for end in BeamEnd}
    lines = {str(line.get_label()): line for line in figure.axes[0].lines}
    return {n: np.asarray(lines[n].get_xydata()) for n in names & lines.keys()}


def dots_of(figure: Figure) -> Floats:
    """Give where the readings are, (R, 2) m."""
    lines = (line for line in figure.axes[0].lines if line.get_marker() == ".")
    dots = [np.asarray(line.get_xydata()) for line in lines]
    return np.concatenate([np.zeros((0, 2)), *dots])


def title(figure: Figure) -> str:
    return figure.axes[0].get_title(loc="left").replace("\n", " ")


def small_print(figure: Figure) -> str:
    return figure.axes[0].get_xlabel()


def labels(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.parametrize("side", [-1, 0, 1])
def test_side_rays_start_beside_the_sensor_in_the_colour_of_the_radar(
    foliage_room: Scene, side: int
) -> None:
    weights = tuple(float(side == other) for other in (-1, 0, 1))
    scan = scan_of(
        foliage_room, side_mode="lateral", side_offset_uu=100, ray_weights=weights
    )
    figure = plot_scans(foliage_room, [scan])
    starts = 0
    for label in ("rays", THROUGH):
        lines = strokes(figure, label)
        ends = hit_points(lines)[:, 0]
        starts += np.isclose(ends, [START[0], side * 0.4]).all(axis=1).sum()
        colour = np.broadcast_to(to_rgb(RADAR), (len(ends), 3))
        assert colours_of(lines)[:, :3] == pytest.approx(colour)
    assert starts == 181


def test_rays_that_see_through_are_boldest_and_their_hits_the_largest(
    foliage_room: Scene,
) -> None:
    scan = scan_of(foliage_room, side_offset_uu=0, ray_weights=(0, 1, 0))
    figure = plot_scans(foliage_room, [scan])
    bold, others = strokes(figure, THROUGH), strokes(figure)
    assert np.min(bold.get_linewidth()) >= 2 * np.max(others.get_linewidth())
    assert np.min(colours_of(bold)[:, 3]) > 2 * np.max(colours_of(others)[:, 3])
    behind = int((scan.ranges * np.cos(scan.angles) + START[0] > 1.8).sum())
    assert len(ends_of(figure)["through"]) == behind > 5
    sizes = {line.get_label(): line.get_markersize() for line in figure.axes[0].lines}
    largest = sizes.pop("through")
    assert largest > max(sizes.values())
    x = hit_points(others)[:, :, 0]
    assert np.max(x) < 1.8  # no other ray is drawn behind the bushes
    assert f"{behind} see through foliage" in title(figure)


def test_rays_fade_with_their_power(foliage_room: Scene) -> None:
    scan = scan_of(foliage_room, side_offset_uu=0, ray_weights=(0, 1, 0))
    lines = strokes(plot_scans(foliage_room, [scan]))
    opacity, width = colours_of(lines)[:, 3], np.asarray(lines.get_linewidth())
    none, full = line_opacity(np.array([0.0, 1.0]))
    assert none < full
    x = hit_points(lines)[:, 1, 0]
    assert opacity[x < -0.8] == pytest.approx(full)  # in front of all bushes
    assert np.all(opacity > none)
    assert np.ptp(opacity) > 0.5 * (full - none)
    assert width == pytest.approx(line_width((opacity - none) / (full - none)))


def test_rays_end_at_their_readings_and_not_behind_the_dust() -> None:
    dusty = radarsim.load_map("marulan_trial@dust")
    scanner = radarsim.load_sensor("physical")
    scan = scanner.scan(dusty, (-15.8, 0, 0))
    figure = plot_scans(dusty, [scan])
    read = np.isfinite(scan.ranges)
    assert "dust cloud" in title(figure)
    farthest = hit_points(strokes(figure))[:, 1]
    cloud = next(p for p in dusty.parts if p.material.name == "dust_cloud")
    near = cloud.vertices[:, 0].min()
    shown = colours_of(strokes(figure))[:, 3]
    strong = shown > FULL_OPACITY * NO_RETURN_OPACITY * 1.01
    assert strong.sum() == read.sum()
    assert np.max(farthest[strong, 0]) <= near + 1e-6


def test_blinded_rays_are_dashed_and_have_no_hits(smoke_room: Scene) -> None:
    figure = plot_scans(smoke_room, [scan_of(smoke_room, "hokuyo")])
    dashed = strokes(figure, "blinded rays")
    assert np.max(dashed.get_linewidth()) < FULL_WIDTH
    assert len(dashed.get_segments()) >= 228
    assert len(strokes(figure).get_segments()) == 0
    assert "blinded: reads 0" in labels(figure)


@pytest.mark.parametrize("seed", range(4))
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


def test_ray_without_return_is_faint_and_ends_at_the_maximum_range(
    empty_room: Scene,
) -> None:
    scan = scan_of(empty_room, "laser", max_range=3)
    figure = plot_scans(empty_room, [scan])
    lines = strokes(figure)
    length = np.hypot(*np.diff(hit_points(lines), axis=1)[:, 0].T)
    assert length == pytest.approx(np.full(181, 3.0))
    opacity = float(line_opacity(np.ones(1))[0])
    assert colours_of(lines)[:, 3] == pytest.approx(
        np.full(181, opacity * NO_RETURN_OPACITY)
    )
    assert "without return" in labels(figure)
    assert markers(figure) == {}
    assert len(dots_of(figure)) == 0
    assert "181 without return" in small_print(figure)


ALL_ECHOES = {
    "hits a surface: concrete",
    "hits a surface: wood",
    "is spent inside: foliage",
    "enters a volume: foliage",
    "leaves a volume: foliage",
}


def test_all_echoes_are_drawn_if_the_sensor_keeps_them(foliage_room: Scene) -> None:
    scan = scan_of(foliage_room, return_mode="all")
    figure = plot_scans(foliage_room, [scan])
    drawn = markers(figure)
    assert set(drawn) == ALL_ECHOES
    counts = [len(np.asarray(marks.get_offsets())) for marks in drawn.values()]
    assert sum(counts) == len(scan.echoes)
    kinds = {label.split(": ")[0] for label in drawn}
    assert kinds <= set(labels(figure))


def test_each_ray_ends_in_one_mark_that_tells_how(foliage_room: Scene) -> None:
    scan = scan_of(foliage_room, side_offset_uu=100)
    figure = plot_scans(foliage_room, [scan])
    ends = ends_of(figure)
    assert sum(map(len, ends.values())) == 181
    spent = scan.echoes.kinds == EventKind.SPENT
    assert len(ends["spent"]) == spent.sum() > 0
    true_ends = scan.cast.origins + scan.ranges[:, None] * scan.cast.directions
    assert ends["spent"] == pytest.approx(true_ends[spent, :2])
    assert "spent in foliage" in labels(figure)


def test_each_return_mode_looks_different(foliage_room: Scene) -> None:
    modes = ("last", "first", "strongest", "all")
    pictures = {
        draw_scans(foliage_room, [scan_of(foliage_room, return_mode=mode)])
        for mode in modes
    }
    assert len(pictures) == 4


@pytest.mark.parametrize("mode", ["last", "first", "strongest", "all"])
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


def test_echoes_are_coloured_by_material_and_filled_where_rays_end(
    foliage_room: Scene,
) -> None:
    scan = scan_of(foliage_room, return_mode="all")
    figure = plot_scans(foliage_room, [scan])
    drawn = markers(figure)
    for label, marks in drawn.items():
        kind, name = label.split(": ")
        style = area_style(family_of(foliage_room.materials[name]))
        assert np.allclose(colours_of(marks), to_rgba(style["edgecolor"]))
        inside = np.asarray(marks.get_facecolor())
        assert bool(len(inside)) == (kind in {"hits a surface", "is spent inside"})
        if kind == "hits a surface":
            assert np.allclose(inside, to_rgba(style["facecolor"]))


def test_stronger_echoes_are_larger(foliage_room: Scene) -> None:
    scan = scan_of(foliage_room, ray_choice="drawn", return_mode="all")
    marks = markers(plot_scans(foliage_room, [scan]))["enters a volume: foliage"]
    sizes = np.sort(marks.get_sizes())
    assert sizes[-1] > 1.5 * sizes[0]


def several(scene: Scene, **settings: Any) -> list[Scan]:
    scanner = radarsim.load_sensor("radar", **settings)
    rng = generator_for(0, "several")
    return [scanner.scan(scene, START, rng) for _ in range(3)]


def test_several_scans_are_pale_dots_along_their_beams(foliage_room: Scene) -> None:
    scans = several(foliage_room, side_offset_uu=100)
    figure = plot_scans(foliage_room, scans)
    assert not figure.axes[0].findobj(LineCollection)
    dots = markers(figure)["reading"]
    assert dots.get_alpha() == pytest.approx(0.3)
    (seen,) = (
        np.asarray(line.get_xydata())
        for line in figure.axes[0].lines
        if line.get_label() == "seen through"
    )
    drawn = np.concatenate([np.asarray(dots.get_offsets()), seen])
    expected = np.concatenate([scan_points(scan) for scan in scans])
    ordered, wanted = (points[np.lexsort(points.T)] for points in (drawn, expected))
    assert ordered == pytest.approx(wanted)
    through = [find_sight(foliage_room, s).ends == BeamEnd.THROUGH for s in scans]
    counts = [int(each.sum()) for each in through]
    assert len(seen) == sum(counts)
    assert f"3 scans of 181 beams: {sum(counts)} see through" in title(figure)
    assert "3 scans of 181 beams" in small_print(figure)


def test_several_scans_of_all_echoes_show_all_of_them(foliage_room: Scene) -> None:
    scans = several(foliage_room, return_mode="all")
    figure = plot_scans(foliage_room, scans)
    drawn = {name for name in markers(figure) if name.startswith("echo of ")}
    assert drawn == {f"echo of {word}" for word in ("foliage", "wood", STONE)}
    count = sum(len(np.asarray(markers(figure)[name].get_offsets())) for name in drawn)
    assert count == sum(len(scan.echoes) for scan in scans)
    assert drawn <= set(labels(figure))
    assert "see through foliage" in title(figure)


def test_smoke_that_stops_nothing_is_not_said_to_stop_beams(smoke_room: Scene) -> None:
    scan = scan_of(smoke_room)
    sight = find_sight(smoke_room, scan)
    through = sight.ends == BeamEnd.THROUGH
    assert np.array_equal(sight.ends == BeamEnd.TOUCHING, ~through)
    assert 0 < through.sum() < 181
    figure = plot_scans(smoke_room, [scan])
    told = " ".join(labels(figure)).replace("\n", " ")
    assert "read what stands in or at smoke" in told
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
    told = labels(plot_scans(foliage_room, [scan]))
    assert {"stopped by foliage", "nothing in the way"} <= set(told)


def test_beams_stopped_in_front_of_dust_are_not_counted_as_meeting_it() -> None:
    dusty = radarsim.load_map("marulan_trial@dust")
    scan = radarsim.load_sensor("hss94_marulan").scan(
        dusty, (-15.8, 0, 0), generator_for(0, "dust")
    )
    sight = find_sight(dusty, scan)
    cloud = next(p for p in dusty.parts if p.material.name == "dust_cloud")
    ends = scan_points(scan)[:, 0]
    behind = np.isfinite(scan.ranges) & (ends > cloud.vertices[:, 0].max())
    assert np.array_equal(sight.meeting, behind)
    assert ((sight.ends == BeamEnd.STOPPED) & ~sight.meeting).any()


def test_title_counts_blinded_beams(smoke_room: Scene) -> None:
    figure = plot_scans(smoke_room, [scan_of(smoke_room, "hokuyo")])
    assert "228 beams: 228 blinded" in title(figure)
    assert markers(figure) == {}
    assert "blinded: reads 0" in labels(figure)


@pytest.mark.parametrize("form", FORMS)
def test_each_form_is_written_with_the_same_bytes(
    foliage_room: Scene, form: str
) -> None:
    scan = scan_of(foliage_room)
    first, second = (draw_scans(foliage_room, [scan], form=form) for _ in range(2))
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
    assert draw_scans(scene, [scan_of(scene)])  # mathematics would not be understood


def test_scan_without_any_return_is_drawn() -> None:
    scene = Scene("void", "Void")
    figure = plot_scans(scene, [scan_of(scene)])
    assert markers(figure) == {}
    assert math.isfinite(figure.axes[0].get_xlim()[0])


def test_the_same_scan_gives_the_same_bytes(foliage_room: Scene) -> None:
    first, second = (
        draw_scans(foliage_room, [scan_of(foliage_room, return_mode="all")])
        for _ in range(2)
    )
    assert first == second
    assert first.startswith(b"\x89PNG\r\n\x1a\n")


@pytest.mark.parametrize("mode", ["last", "all"])
def test_beams_of_a_detector_see_through_what_their_spectrum_does(
    foliage_room: Scene, mode: str
) -> None:
    settings = {"detector": "ca", "max_range": 30, "return_mode": mode}
    scan = scan_of(foliage_room, "navtech_cts350x", **settings)
    figure = plot_scans(foliage_room, [scan])
    ahead = (scan.ranges > 0) & (np.cos(scan.angles) > 0.9)
    behind = scan.ranges[ahead] * np.cos(scan.angles[ahead]) + START[0] > 2.0
    assert behind.sum() > 10
    assert len(ends_of(figure)["through"]) >= behind.sum()
    assert "stopped by foliage" in labels(figure)
    words = small_print(figure).replace("\n", " ")
    assert "farthest target of the detector 'ca'" in words
