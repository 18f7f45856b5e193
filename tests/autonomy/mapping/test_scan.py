"""Planar scans from ranges and echoes."""

import math
from itertools import pairwise

import numpy as np
import pytest
from flat_world import Echo, echoes_of
from hypothesis import given
from hypothesis import strategies as st

from radarsim.autonomy.mapping.scan import BeamEnd, Layer, PlanarScan, read_scan
from radarsim.geometry import Pose2
from radarsim.protocol.reports import RangeScan, TargetEchoes

FAR = 20.0


def scan_of(*ranges: float) -> RangeScan:
    fov = math.radians(10 * (len(ranges) - 1))
    return RangeScan(1.5, "lms200", math.radians(10), fov, np.array(ranges))


def hits_of(scan: PlanarScan) -> list[tuple[int, float, float, int]]:
    """Return the hits as rows of beam, near, far and layer."""
    columns = (column.tolist() for column in scan.hits)
    return sorted(zip(*columns, strict=True))


def scan_with(
    *ranges: float, by: list[TargetEchoes], min_range: float = 0.0
) -> PlanarScan:
    return read_scan(scan_of(*ranges), by, max_range=FAR, min_range=min_range)


def test_beams_are_spread_over_the_field_of_view_from_the_right() -> None:
    scan = read_scan(scan_of(1, 2, 3), max_range=FAR)
    assert np.degrees(scan.angles).tolist() == pytest.approx([-10, 0, 10])
    assert scan.time == 1.5


def test_ranges_without_echoes_are_opaque_hits() -> None:
    scan = read_scan(scan_of(1.0, 2.0), max_range=FAR)
    assert scan.ends.tolist() == [BeamEnd.UNSURE, BeamEnd.UNSURE]
    assert hits_of(scan) == [(0, 1.0, 1.0, Layer.SOLID), (1, 2.0, 2.0, Layer.SOLID)]
    assert not scan.sees_through


@pytest.mark.parametrize("reading", [FAR, FAR - 0.005, 99.0, math.inf])
def test_maximum_range_is_no_hit(reading: float) -> None:
    scan = read_scan(scan_of(reading, 3.0), max_range=FAR)
    assert scan.ends.tolist() == [BeamEnd.NOTHING, BeamEnd.UNSURE]
    assert scan.known_range.tolist() == [FAR, 3.0]
    assert [beam for beam, *_ in hits_of(scan)] == [1]


@pytest.mark.parametrize("reading", [0.0, 0.09, -1.0, math.nan])
def test_range_below_the_minimum_is_ignored(reading: float) -> None:
    scan = read_scan(scan_of(reading, 3.0), max_range=FAR, min_range=0.1)
    assert scan.ends.tolist() == [BeamEnd.BLIND, BeamEnd.UNSURE]
    assert scan.known_range.tolist() == [0.0, 3.0]
    assert [beam for beam, *_ in hits_of(scan)] == [1]


def test_without_a_maximum_range_every_range_is_a_hit() -> None:
    scan = read_scan(scan_of(79.0, math.inf), max_range=math.inf)
    assert scan.ends.tolist() == [BeamEnd.UNSURE, BeamEnd.BLIND]
    assert np.isfinite(scan.known_range).all()


def bush(*echoes: float | str) -> TargetEchoes:
    """Return the echoes of a bush on the first beam: kind, range, kind, range ..."""
    return target("bush", *echoes)


def target(name: str, *echoes: float | str, passes: bool = False) -> TargetEchoes:
    rows = [
        (0, float(t), str(kind))
        for kind, t in zip(echoes[::2], echoes[1::2], strict=True)
    ]
    return echoes_of(*rows, name=name, passes=passes)


WALL_5, WALL_9 = target("wall", "hit", 5.0), target("wall", "hit", 9.0)
SOLID, FOLIAGE, SMOKE = Layer.SOLID, Layer.FOLIAGE, Layer.SMOKE


@pytest.mark.parametrize(
    ("reading", "targets", "end", "hits"),
    [
        pytest.param(
            5.0,
            [bush("enter", 2.0, "leave", 3.0), WALL_5],
            (5.0, BeamEnd.HIT),
            [(2.0, 3.0, FOLIAGE), (5.0, 5.0, SOLID)],
            id="wall behind a bush, which is where it was crossed",
        ),
        pytest.param(
            FAR,
            [bush("enter", 2.0, "spent", 3.4)],
            (3.4, BeamEnd.SPENT),
            [(2.0, 3.4, FOLIAGE)],
            id="beam spent in a bush, even without a range",
        ),
        pytest.param(
            2.6,
            [bush("enter", 2.0), target("trunk", "hit", 2.6)],
            (2.6, BeamEnd.HIT),
            [(2.0, 2.6, FOLIAGE), (2.6, 2.6, SOLID)],
            id="trunk ends the hit on the bush around it",
        ),
        pytest.param(
            9.0,
            [target("cloud", "leave", 4.0, passes=True), WALL_9],
            (9.0, BeamEnd.HIT),
            [(0.0, 4.0, SMOKE), (9.0, 9.0, SOLID)],
            id="beam that only leaves smoke starts in it",
        ),
        pytest.param(
            9.0,
            [bush("sheet", 2.0, "sheet", 2.5), WALL_9],
            (9.0, BeamEnd.HIT),
            [(2.0, 2.0, FOLIAGE), (2.5, 2.5, FOLIAGE), (9.0, 9.0, SOLID)],
            id="leaf without depth",
        ),
        pytest.param(
            9.0,
            [bush("enter", 1.0, "enter", 2.0, "leave", 3.0, "leave", 4.0), WALL_9],
            (9.0, BeamEnd.HIT),
            [(1.0, 4.0, FOLIAGE), (9.0, 9.0, SOLID)],
            id="target nested in itself counts once",
        ),
        pytest.param(
            FAR,
            [bush("enter", 1.0, "leave", 2.0, "enter", 3.0, "leave", 4.0)],
            (FAR, BeamEnd.NOTHING),
            [(1.0, 2.0, FOLIAGE), (3.0, 4.0, FOLIAGE)],
            id="target crossed twice",
        ),
        pytest.param(
            2.0,
            [bush("enter", 2.0)],
            (2.0, BeamEnd.SPENT),
            [(2.0, 2.0, FOLIAGE)],
            id="first-echo scanner ends at a bush",
        ),
        pytest.param(
            3.0,
            [target("air", "rain", 3.0, passes=True)],
            (3.0, BeamEnd.AIR),
            [],
            id="rain drop",
        ),
        pytest.param(
            9.0,
            [WALL_9, target("edge", "hit", 4.0)],
            (9.0, BeamEnd.HIT),
            [(4.0, 4.0, SOLID), (9.0, 9.0, SOLID)],
            id="farthest of several ends",
        ),
        pytest.param(
            0.0,
            [target("cloud", "enter", 1.0, "spent", 1.2, passes=True)],
            (0.0, BeamEnd.BLIND),
            [],
            id="blinded beam",
        ),
    ],
)
def test_echoes_show_what_ended_a_beam_and_what_it_hit(
    reading: float,
    targets: list[TargetEchoes],
    end: tuple[float, BeamEnd],
    hits: list[tuple[float, float, Layer]],
) -> None:
    scan = scan_with(reading, by=targets, min_range=0.1)
    assert (scan.known_range.tolist(), scan.ends.tolist()) == ([end[0]], [end[1]])
    assert hits_of(scan) == [(0, *hit) for hit in hits]
    assert scan.sees_through


def test_impossible_echoes_are_ignored() -> None:
    odd = echoes_of(
        (-1, 2.0, "hit"), (7, 2.0, "hit"), (0, 1e9, "hit"), (0, math.nan, "hit")
    )
    unknown = echoes_of((0, 2.0, "glimmer"))
    scan = scan_with(FAR, by=[odd, unknown])
    assert scan.ends.tolist() == [BeamEnd.NOTHING]
    assert hits_of(scan) == []


@given(cut=st.integers(0, 4), swapped=st.booleans())
def test_object_may_have_several_lines_in_any_order(cut: int, swapped: bool) -> None:
    echoes = [
        (0, 2.0, "enter"),
        (0, 3.0, "leave"),
        (1, 2.5, "enter"),
        (1, 3.5, "spent"),
    ]
    lines = [echoes_of(*echoes[:cut]), echoes_of(*echoes[cut:])]
    if swapped:
        lines.reverse()
    assert hits_of(scan_with(FAR, 3.5, by=lines)) == hits_of(
        scan_with(FAR, 3.5, by=[echoes_of(*echoes)])
    )


kinds = st.sampled_from(["enter", "leave", "sheet", "hit", "spent", "rain"])
echo_lists = st.lists(
    st.tuples(st.integers(0, 3), st.floats(0, FAR), kinds), max_size=20
)


@given(bush=echo_lists, wall=echo_lists)
def test_hits_are_within_the_known_range_and_ordered(
    bush: list[Echo], wall: list[Echo]
) -> None:
    scan = scan_with(
        FAR, 8.0, 5.0, 0.0, by=[echoes_of(*bush), echoes_of(*wall, name="wall")]
    )
    beams, near, far, _ = scan.hits
    assert (near >= 0).all()
    assert (near <= far).all()
    assert (far <= scan.known_range[beams]).all()


@given(echoes=echo_lists)
def test_hits_on_one_target_do_not_overlap(echoes: list[Echo]) -> None:
    inside = [echo for echo in echoes if echo[2] in ("enter", "leave")]
    scan = scan_with(FAR, FAR, FAR, FAR, by=[echoes_of(*inside)])
    hits = hits_of(scan)
    for (beam, _, far, _), (other, near, _, _) in pairwise(hits):
        assert beam != other or far <= near


def test_points_are_beam_ends_in_the_robot_frame() -> None:
    wall = echoes_of((1, 2.0, "hit"), name="wall")
    bush = echoes_of((0, 1.0, "enter"), (0, 1.5, "spent"))
    mount = Pose2(0.2, 0.1, math.pi / 2)
    report = scan_of(1.5, 2.0, FAR)
    scan = read_scan(report, [bush, wall], max_range=FAR, mount=mount)
    places, along = scan.points()
    assert places.tolist() == [pytest.approx([0.2, 2.1])]
    assert along.tolist() == [pytest.approx([0.0, 1.0])]
    assert len(scan.points(sure=False)[0]) == 2
