import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from oracles.motion import Contact

from radarsim.geometry import Floats, Pose2
from radarsim.robots.footprint import NO_SEGMENTS, Footprint, line_table

ROBOT = Footprint(0.6, 0.4)
coordinates = st.floats(-2, 2).map(lambda number: round(number, 3))
poses = st.builds(Pose2, coordinates, coordinates, st.floats(-3, 3))
ends = st.tuples(coordinates, coordinates)
segments = st.lists(
    st.tuples(ends, ends).filter(lambda pair: pair[0] != pair[1]), min_size=1
)
Ends = list[tuple[tuple[float, float], tuple[float, float]]]


def contact(pose: Pose2, segments: Floats) -> Contact:
    poses = np.array([[pose.x, pose.y, pose.yaw]], np.float64)
    return Contact(*ROBOT.contacts(poses, line_table(segments))[0].tolist())


def polygon(pose: Pose2) -> shapely.Polygon:
    return shapely.Polygon(ROBOT.outline(pose)[:, 0])


@settings(max_examples=40)
@given(pose=poses, pairs=segments)
def test_gap_is_a_lower_bound_of_the_distance_with_exact_sign(
    pose: Pose2, pairs: Ends
) -> None:
    gap = contact(pose, np.array(pairs)).gap
    lines = shapely.MultiLineString(pairs)
    distance = polygon(pose).distance(lines)
    assert gap <= distance + 1e-9
    assert (gap > 0) == (distance > 0) or abs(gap) < 1e-9


@settings(max_examples=40)
@given(pose=poses, others=segments, end=ends)
def test_moving_by_the_depth_ends_the_deepest_contact(
    pose: Pose2, others: Ends, end: tuple[float, float]
) -> None:
    assume(end != (pose.x, pose.y))
    pairs = [*others, ((pose.x, pose.y), end)]  # so that at least one reaches in
    gaps = [contact(pose, np.array([pair])).gap for pair in pairs]
    assume(len(gaps) == 1 or sorted(gaps)[1] > min(gaps) + 1e-9)  # one is deepest
    deepest = np.array([pairs[int(np.argmin(gaps))]])
    found = contact(pose, np.array(pairs))
    assert found.gap < 0
    push = 0.001 - found.gap
    freed = Pose2(pose.x + push * found.away_x, pose.y + push * found.away_y, pose.yaw)
    assert math.hypot(found.away_x, found.away_y) == pytest.approx(1)
    assert contact(freed, deepest).gap > 0.001 - 1e-9


@settings(max_examples=40)
@given(pose=poses, turn=st.floats(-3, 3), pairs=segments)
def test_gap_is_invariant_under_rotation(pose: Pose2, turn: float, pairs: Ends) -> None:
    c, s = math.cos(turn), math.sin(turn)
    matrix = np.array([[c, s], [-s, c]])
    x, y = np.array([pose.x, pose.y]) @ matrix
    turned = contact(Pose2(x, y, pose.yaw + turn), np.array(pairs) @ matrix)
    assert turned.gap == pytest.approx(contact(pose, np.array(pairs)).gap)


@pytest.mark.parametrize(
    ("segment", "gap", "away"),
    [
        pytest.param([[0.5, -1], [0.5, 1]], 0.2, (-1, 0), id="wall ahead"),
        pytest.param([[-0.5, -1], [-0.5, 1]], 0.2, (1, 0), id="wall behind"),
        pytest.param([[-1, 0.25], [1, 0.25]], 0.05, (0, -1), id="wall to the left"),
        pytest.param([[0.29, -1], [0.29, 1]], -0.01, (-1, 0), id="wall entered"),
        pytest.param([[0.28, 0], [2, 0]], -0.02, (-1, 0), id="end of a wall"),
        pytest.param(
            [[1, 0], [0, 1]],
            (1 - 0.5) / math.sqrt(2),
            (-math.sqrt(0.5), -math.sqrt(0.5)),
            id="wall before a corner",
        ),
    ],
)
def test_known_contacts(
    segment: list[list[float]], gap: float, away: tuple[float, float]
) -> None:
    found = contact(Pose2(0, 0), np.array([segment]))
    assert found.gap == pytest.approx(gap)
    assert (found.away_x, found.away_y) == pytest.approx(away, abs=1e-12)


def test_gap_without_segments_is_infinite() -> None:
    assert contact(Pose2(1, 2, 3), NO_SEGMENTS).gap == math.inf


def test_outline_follows_the_pose() -> None:
    outline = ROBOT.outline(Pose2(10, 20, math.pi / 2))
    corners = [[9.8, 20.3], [9.8, 19.7], [10.2, 19.7], [10.2, 20.3]]
    assert outline[:, 0] == pytest.approx(np.array(corners))
    assert outline[:, 1] == pytest.approx(np.roll(corners, -1, axis=0))


@given(pose=poses, x=coordinates, y=coordinates)
def test_covers_agrees_with_the_outline(pose: Pose2, x: float, y: float) -> None:
    point = shapely.Point(x, y)
    near_the_edge = polygon(pose).exterior.distance(point) < 1e-9
    assert near_the_edge or ROBOT.covers(pose, x, y) == polygon(pose).contains(point)
