"""Planar scans from ranges and echoes."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.autonomy.mapping.scan import (
    BeamEnd,
    Layer,
    PlanarScan,
    read_scan,
)
from radarsim.geometry import Pose2
from radarsim.protocol.reports import RangeScan, TargetEchoes

Echo = tuple[int, float, str]
FAR = 20.0


def scan_of(*ranges: float) -> RangeScan:
    fov = math.radians(10 * (len(ranges) - 1))
    return RangeScan(1.5, "lms200", math.radians(10), fov, np.array(ranges))


def echoes_of(
    *echoes: Echo, name: str = "bush", passes: bool = False, material: str = "leaf"
) -> TargetEchoes:
    n = len(echoes)
    beams = np.array([beam for beam, _, _ in echoes], np.int64)
    ranges = np.array([t for _, t, _ in echoes], np.float64)
    kinds = tuple(kind for _, _, kind in echoes)
    ones = np.ones(n)
    return TargetEchoes(
        name, material, 0.7, 0.3, False, passes, beams, ranges, kinds, ones, ones
    )


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


def test_wall_behind_a_bush_is_hit_and_the_bush_is_where_it_was_crossed() -> None:
    bush = echoes_of((0, 2.0, "enter"), (0, 3.0, "leave"))
    wall = echoes_of((0, 5.0, "hit"), name="wall", material="concrete")
    scan = scan_with(5.0, by=[bush, wall])
    assert scan.ends.tolist() == [BeamEnd.HIT]
    assert hits_of(scan) == [(0, 2.0, 3.0, Layer.FOLIAGE), (0, 5.0, 5.0, Layer.SOLID)]
    assert scan.sees_through


def test_beam_spent_in_a_bush_hits_no_wall() -> None:
    scan = scan_with(3.4, by=[echoes_of((0, 2.0, "enter"), (0, 3.4, "spent"))])
    assert scan.ends.tolist() == [BeamEnd.SPENT]
    assert hits_of(scan) == [(0, 2.0, 3.4, Layer.FOLIAGE)]


def test_trunk_ends_the_hit_on_the_bush_around_it() -> None:
    bush = echoes_of((0, 2.0, "enter"))
    trunk = echoes_of((0, 2.6, "hit"), name="trunk", material="wood")
    assert hits_of(scan_with(2.6, by=[bush, trunk])) == [
        (0, 2.0, 2.6, Layer.FOLIAGE),
        (0, 2.6, 2.6, Layer.SOLID),
    ]


def test_beam_that_only_leaves_smoke_starts_in_it() -> None:
    cloud = echoes_of((0, 4.0, "leave"), name="cloud", passes=True)
    wall = echoes_of((0, 9.0, "hit"), name="wall")
    assert hits_of(scan_with(9.0, by=[cloud, wall])) == [
        (0, 0.0, 4.0, Layer.SMOKE),
        (0, 9.0, 9.0, Layer.SOLID),
    ]


def test_leaf_is_a_hit_without_depth() -> None:
    leaves = echoes_of((0, 2.0, "sheet"), (0, 2.5, "sheet"))
    wall = echoes_of((0, 9.0, "hit"), name="wall")
    assert hits_of(scan_with(9.0, by=[leaves, wall]))[:2] == [
        (0, 2.0, 2.0, Layer.FOLIAGE),
        (0, 2.5, 2.5, Layer.FOLIAGE),
    ]


def test_target_nested_in_itself_counts_once() -> None:
    kinds = ["enter", "enter", "leave", "leave"]
    echoes = [(0, 1.0 + i, kind) for i, kind in enumerate(kinds)]
    wall = echoes_of((0, 9.0, "hit"), name="wall")
    assert hits_of(scan_with(9.0, by=[echoes_of(*echoes), wall])) == [
        (0, 1.0, 4.0, Layer.FOLIAGE),
        (0, 9.0, 9.0, Layer.SOLID),
    ]


def test_target_crossed_twice_has_two_hits() -> None:
    kinds = ["enter", "leave", "enter", "leave"]
    echoes = [(0, 1.0 + i, kind) for i, kind in enumerate(kinds)]
    assert hits_of(scan_with(FAR, by=[echoes_of(*echoes)])) == [
        (0, 1.0, 2.0, Layer.FOLIAGE),
        (0, 3.0, 4.0, Layer.FOLIAGE),
    ]


def test_known_range_of_a_spent_beam_ends_there_even_without_a_range() -> None:
    scan = scan_with(FAR, by=[echoes_of((0, 2.0, "enter"), (0, 3.4, "spent"))])
    assert scan.known_range.tolist() == [3.4]
    assert scan.ends.tolist() == [BeamEnd.SPENT]


def test_known_range_of_a_first_echo_scanner_ends_at_a_bush() -> None:
    scan = scan_with(2.0, by=[echoes_of((0, 2.0, "enter"))])
    assert scan.ends.tolist() == [BeamEnd.SPENT]
    assert hits_of(scan) == [(0, 2.0, 2.0, Layer.FOLIAGE)]


def test_rain_drop_ends_the_known_range_and_is_no_hit() -> None:
    drop = echoes_of((0, 3.0, "rain"), name="air", passes=True)
    scan = scan_with(3.0, by=[drop])
    assert scan.ends.tolist() == [BeamEnd.AIR]
    assert scan.known_range.tolist() == [3.0]
    assert hits_of(scan) == []


def test_beam_ends_at_the_farthest_of_several_ends() -> None:
    edge = echoes_of((0, 4.0, "hit"), name="edge")
    wall = echoes_of((0, 9.0, "hit"), name="wall")
    scan = scan_with(9.0, by=[wall, edge])
    assert scan.known_range.tolist() == [9.0]
    assert hits_of(scan) == [(0, 4.0, 4.0, Layer.SOLID), (0, 9.0, 9.0, Layer.SOLID)]


def test_echoes_of_a_blinded_beam_are_ignored() -> None:
    cloud = echoes_of((0, 1.0, "enter"), (0, 1.2, "spent"), name="cloud", passes=True)
    scan = scan_with(0.0, by=[cloud], min_range=0.1)
    assert scan.ends.tolist() == [BeamEnd.BLIND]
    assert hits_of(scan) == []


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
