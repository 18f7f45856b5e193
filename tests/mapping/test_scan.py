"""What a scan says, by what its ranges and its echoes say."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.geometry import Pose2
from radarsim.mapping.scan import (
    BeamEnd,
    Layer,
    PlanarScan,
    read_scan,
)
from radarsim.protocol.reports import RangeScan, TargetEchoes

Echo = tuple[int, float, str]
FAR = 20.0


def scan_of(*ranges: float) -> RangeScan:
    fov = math.radians(10 * (len(ranges) - 1))
    return RangeScan(1.5, "lms200", math.radians(10), fov, np.array(ranges))


def seen(
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


def met(scan: PlanarScan) -> list[tuple[int, float, float, int]]:
    """List the marks: beam, near, far, what."""
    columns = (column.tolist() for column in scan.hits)
    return sorted(zip(*columns, strict=True))


def told(*ranges: float, by: list[TargetEchoes], min_range: float = 0.0) -> PlanarScan:
    return read_scan(scan_of(*ranges), by, max_range=FAR, min_range=min_range)


def test_beams_are_spread_over_the_field_of_view_from_the_right() -> None:
    scan = read_scan(scan_of(1, 2, 3), max_range=FAR)
    assert np.degrees(scan.angles).tolist() == pytest.approx([-10, 0, 10])
    assert scan.time == 1.5


def test_without_echoes_ranges_are_taken_for_something_opaque() -> None:
    scan = read_scan(scan_of(1.0, 2.0), max_range=FAR)
    assert scan.ends.tolist() == [BeamEnd.UNSURE, BeamEnd.UNSURE]
    assert met(scan) == [(0, 1.0, 1.0, Layer.SOLID), (1, 2.0, 2.0, Layer.SOLID)]
    assert not scan.sees_through


@pytest.mark.parametrize("reading", [FAR, FAR - 0.005, 99.0, math.inf])
def test_the_greatest_range_is_nothing_at_all(reading: float) -> None:
    scan = read_scan(scan_of(reading, 3.0), max_range=FAR)
    assert scan.ends.tolist() == [BeamEnd.NOTHING, BeamEnd.UNSURE]
    assert scan.known_range.tolist() == [FAR, 3.0]
    assert [beam for beam, *_ in met(scan)] == [1]


@pytest.mark.parametrize("reading", [0.0, 0.09, -1.0, math.nan])
def test_a_range_below_the_least_tells_nothing(reading: float) -> None:
    scan = read_scan(scan_of(reading, 3.0), max_range=FAR, min_range=0.1)
    assert scan.ends.tolist() == [BeamEnd.BLIND, BeamEnd.UNSURE]
    assert scan.known_range.tolist() == [0.0, 3.0]
    assert [beam for beam, *_ in met(scan)] == [1]


def test_where_nobody_tells_the_greatest_range_every_number_is_a_return() -> None:
    scan = read_scan(scan_of(79.0, math.inf), max_range=math.inf)
    assert scan.ends.tolist() == [BeamEnd.UNSURE, BeamEnd.BLIND]
    assert np.isfinite(scan.known_range).all()


def test_a_wall_behind_a_bush_is_hit_and_the_bush_is_where_it_was_crossed() -> None:
    bush = seen((0, 2.0, "enter"), (0, 3.0, "leave"))
    wall = seen((0, 5.0, "hit"), name="wall", material="concrete")
    scan = told(5.0, by=[bush, wall])
    assert scan.ends.tolist() == [BeamEnd.HIT]
    assert met(scan) == [(0, 2.0, 3.0, Layer.FOLIAGE), (0, 5.0, 5.0, Layer.SOLID)]
    assert scan.sees_through


def test_what_is_spent_in_a_bush_is_no_wall() -> None:
    scan = told(3.4, by=[seen((0, 2.0, "enter"), (0, 3.4, "spent"))])
    assert scan.ends.tolist() == [BeamEnd.SPENT]
    assert met(scan) == [(0, 2.0, 3.4, Layer.FOLIAGE)]


def test_a_trunk_ends_the_bush_around_it() -> None:
    bush = seen((0, 2.0, "enter"))
    trunk = seen((0, 2.6, "hit"), name="trunk", material="wood")
    assert met(told(2.6, by=[bush, trunk])) == [
        (0, 2.0, 2.6, Layer.FOLIAGE),
        (0, 2.6, 2.6, Layer.SOLID),
    ]


def test_beam_that_leaves_smoke_began_in_it() -> None:
    cloud = seen((0, 4.0, "leave"), name="cloud", passes=True)
    wall = seen((0, 9.0, "hit"), name="wall")
    assert met(told(9.0, by=[cloud, wall])) == [
        (0, 0.0, 4.0, Layer.SMOKE),
        (0, 9.0, 9.0, Layer.SOLID),
    ]


def test_a_leaf_is_a_point() -> None:
    leaves = seen((0, 2.0, "sheet"), (0, 2.5, "sheet"))
    wall = seen((0, 9.0, "hit"), name="wall")
    assert met(told(9.0, by=[leaves, wall]))[:2] == [
        (0, 2.0, 2.0, Layer.FOLIAGE),
        (0, 2.5, 2.5, Layer.FOLIAGE),
    ]


def test_target_nested_in_itself_counts_once() -> None:
    kinds = ["enter", "enter", "leave", "leave"]
    echoes = [(0, 1.0 + i, kind) for i, kind in enumerate(kinds)]
    wall = seen((0, 9.0, "hit"), name="wall")
    assert met(told(9.0, by=[seen(*echoes), wall])) == [
        (0, 1.0, 4.0, Layer.FOLIAGE),
        (0, 9.0, 9.0, Layer.SOLID),
    ]


def test_target_crossed_twice_has_two_hits() -> None:
    kinds = ["enter", "leave", "enter", "leave"]
    echoes = [(0, 1.0 + i, kind) for i, kind in enumerate(kinds)]
    assert met(told(FAR, by=[seen(*echoes)])) == [
        (0, 1.0, 2.0, Layer.FOLIAGE),
        (0, 3.0, 4.0, Layer.FOLIAGE),
    ]


def test_a_beam_that_is_spent_is_known_no_farther_even_if_it_reads_nothing() -> None:
    scan = told(FAR, by=[seen((0, 2.0, "enter"), (0, 3.4, "spent"))])
    assert scan.known_range.tolist() == [3.4]
    assert scan.ends.tolist() == [BeamEnd.SPENT]


def test_a_scanner_of_first_echoes_sees_no_farther_than_a_bush() -> None:
    scan = told(2.0, by=[seen((0, 2.0, "enter"))])
    assert scan.ends.tolist() == [BeamEnd.SPENT]
    assert met(scan) == [(0, 2.0, 2.0, Layer.FOLIAGE)]


def test_a_drop_of_rain_ends_a_beam_and_is_nothing() -> None:
    drop = seen((0, 3.0, "rain"), name="air", passes=True)
    scan = told(3.0, by=[drop])
    assert scan.ends.tolist() == [BeamEnd.AIR]
    assert scan.known_range.tolist() == [3.0]
    assert met(scan) == []


def test_the_farthest_of_several_ends_is_the_beams() -> None:
    edge = seen((0, 4.0, "hit"), name="edge")
    wall = seen((0, 9.0, "hit"), name="wall")
    scan = told(9.0, by=[wall, edge])
    assert scan.known_range.tolist() == [9.0]
    assert met(scan) == [(0, 4.0, 4.0, Layer.SOLID), (0, 9.0, 9.0, Layer.SOLID)]


def test_a_blinded_beam_tells_nothing_of_what_its_echoes_met() -> None:
    cloud = seen((0, 1.0, "enter"), (0, 1.2, "spent"), name="cloud", passes=True)
    scan = told(0.0, by=[cloud], min_range=0.1)
    assert scan.ends.tolist() == [BeamEnd.BLIND]
    assert met(scan) == []


def test_echoes_that_cannot_be_are_left_out() -> None:
    odd = seen((-1, 2.0, "hit"), (7, 2.0, "hit"), (0, 1e9, "hit"), (0, math.nan, "hit"))
    unknown = seen((0, 2.0, "glimmer"))
    scan = told(FAR, by=[odd, unknown])
    assert scan.ends.tolist() == [BeamEnd.NOTHING]
    assert met(scan) == []


@given(cut=st.integers(0, 4), swapped=st.booleans())
def test_an_object_may_have_several_lines_in_any_order(cut: int, swapped: bool) -> None:
    echoes = [
        (0, 2.0, "enter"),
        (0, 3.0, "leave"),
        (1, 2.5, "enter"),
        (1, 3.5, "spent"),
    ]
    lines = [seen(*echoes[:cut]), seen(*echoes[cut:])]
    if swapped:
        lines.reverse()
    assert met(told(FAR, 3.5, by=lines)) == met(told(FAR, 3.5, by=[seen(*echoes)]))


kinds = st.sampled_from(["enter", "leave", "sheet", "hit", "spent", "rain"])
echo_lists = st.lists(
    st.tuples(st.integers(0, 3), st.floats(0, FAR), kinds), max_size=20
)


@given(bush=echo_lists, wall=echo_lists)
def test_hits_are_within_the_known_range_and_ordered(
    bush: list[Echo], wall: list[Echo]
) -> None:
    scan = told(FAR, 8.0, 5.0, 0.0, by=[seen(*bush), seen(*wall, name="wall")])
    beams, near, far, _ = scan.hits
    assert (near >= 0).all()
    assert (near <= far).all()
    assert (far <= scan.known_range[beams]).all()


@given(echoes=echo_lists)
def test_hits_on_one_target_do_not_overlap(echoes: list[Echo]) -> None:
    inside = [echo for echo in echoes if echo[2] in ("enter", "leave")]
    scan = told(FAR, FAR, FAR, FAR, by=[seen(*inside)])
    hits = met(scan)
    for (beam, _, far, _), (other, near, _, _) in pairwise(hits):
        assert beam != other or far <= near


def test_points_are_where_beams_ended_as_the_robot_sees_it() -> None:
    wall = seen((1, 2.0, "hit"), name="wall")
    bush = seen((0, 1.0, "enter"), (0, 1.5, "spent"))
    mount = Pose2(0.2, 0.1, math.pi / 2)
    report = scan_of(1.5, 2.0, FAR)
    scan = read_scan(report, [bush, wall], max_range=FAR, mount=mount)
    places, along = scan.points()
    assert places.tolist() == [pytest.approx([0.2, 2.1])]
    assert along.tolist() == [pytest.approx([0.0, 1.0])]
    assert len(scan.points(sure=False)[0]) == 2
