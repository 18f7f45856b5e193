import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radarsim.autonomy.navigation.bumpers import (
    Bumper,
    Bumpers,
    nearest_share,
    pressed_names,
)
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.plans import Rule
from radarsim.geometry import Pose2

BEARINGS = np.radians(np.arange(360) - 180.0)
HERE = Pose2(0.0, 0.0)


def observation(ranges: object) -> Observation:
    values = np.broadcast_to(np.asarray(ranges, float), (360,)).copy()
    return Observation(0.0, HERE, BEARINGS, values)


def wall_ahead(distance: float) -> Observation:
    """A flat wall ahead."""
    facing = np.cos(BEARINGS)
    return observation(
        np.where(facing > 1e-9, distance / np.maximum(facing, 1e-9), np.inf)
    )


def read(bumpers: Bumpers, seen: Observation) -> dict[str, Bumper]:
    return {bumper.name: bumper for bumper in bumpers.read(seen)}


@pytest.mark.slow
@given(st.integers(4, 36), st.lists(st.floats(0.1, 80), min_size=360, max_size=360))
def test_every_beam_presses_exactly_one_bumper(count: int, ranges: list[float]) -> None:
    bumpers = Bumpers(safety_distance=1.0, count=count, share=1e-9)
    for beam in (0, 1, 22, 23, 180, 202, 359):
        alone = np.full(360, 50.0)
        alone[beam] = 0.5
        states = bumpers.read(observation(alone))
        assert sum(state.pressed for state in states) == 1
        centre = bumpers.width * [state.pressed for state in states].index(True)
        apart = math.remainder(centre - BEARINGS[beam], 2 * math.pi)
        assert abs(apart) <= bumpers.width / 2 + 1e-9
    assert len(bumpers.read(observation(ranges))) == count == len(set(bumpers.names))


@pytest.mark.parametrize(
    ("beams", "pressed"),
    [
        pytest.param(4, False, id="fewer than a tenth"),
        pytest.param(5, True, id="a tenth"),
    ],
)
def test_bumper_is_pressed_by_a_tenth_of_its_45_beams(
    beams: int, pressed: bool
) -> None:
    ranges = np.full(360, 9.0)
    ranges[270 : 270 + beams] = 1.49  # about the left
    states = read(Bumpers(safety_distance=1.0), observation(ranges))
    assert [name for name, state in states.items() if state.pressed] == [
        "left"
    ] * pressed
    assert not any(state.too_near for state in states.values())


@pytest.mark.parametrize(
    ("distance", "pressed", "too_near"),
    [
        pytest.param(1.501, False, False, id="beyond"),
        pytest.param(1.499, True, False, id="in the band"),
        pytest.param(1.0, True, False, id="at the safety distance"),
        pytest.param(0.99, True, True, id="too near"),
    ],
)
def test_band_is_half_a_metre(distance: float, pressed: bool, too_near: bool) -> None:
    for state in Bumpers(safety_distance=1.0).read(observation(distance)):
        assert (state.pressed, state.too_near) == (pressed, too_near)
        assert state.blocked == pressed
        assert state.distance == distance


@settings(max_examples=25)
@given(st.sampled_from([4, 5, 6, 8]), st.floats(0.3, 7.0), st.floats(0.0, 1.0))
def test_literal_rule_holds_at_a_flat_wall_at_the_documented_distances(
    count: int, safety: float, part: float
) -> None:
    bumpers = Bumpers(safety_distance=safety, count=count, rule=Rule.ALL)
    farthest = (safety + 0.5) * math.cos(math.pi / count)
    if farthest >= safety:
        inside = safety + part * (farthest - safety)
        # a beam at the very edge is there only for some counts
        state = read(bumpers, wall_ahead(min(inside, farthest - 1e-9)))[
            "front" if count in (4, 8) else "at_0"
        ]
        assert state.pressed
    beyond = read(bumpers, wall_ahead(farthest * 1.03 + 0.01))
    edge = math.cos(math.floor(180 / count) * math.pi / 180) / math.cos(math.pi / count)
    if edge < 1.02:
        assert not next(iter(beyond.values())).pressed
    near = next(iter(read(bumpers, wall_ahead(safety * 0.99)).values()))
    assert not near.pressed
    assert near.too_near


def test_towards_is_the_front_bumper_of_a_robot_facing_there() -> None:
    bumpers = Bumpers(safety_distance=1.0)
    for turn in (0.0, 0.7, math.pi, -2.0):
        facing = np.cos(BEARINGS - turn)
        seen = observation(
            np.where(facing > 0.01, 1.3 / np.maximum(facing, 0.01), np.inf)
        )
        assert bumpers.towards(seen, turn).pressed
        assert not bumpers.towards(seen, turn + math.pi).blocked


@pytest.mark.parametrize(
    ("fov", "blind"),
    [
        pytest.param(359, (), id="full circle"),
        pytest.param(180, ("back_left", "back", "back_right"), id="half circle"),
        pytest.param(240, ("back",), id="two thirds"),
    ],
)
def test_bumpers_without_beams_are_named(fov: int, blind: tuple[str, ...]) -> None:
    angles = np.radians(np.arange(-fov / 2, fov / 2 + 0.5))
    bumpers = Bumpers(safety_distance=1.0)
    assert bumpers.blind(angles) == blind
    seen = Observation(0.0, HERE, angles, np.full(len(angles), 0.2))
    states = read(bumpers, seen)
    assert not any(states[name].blocked for name in blind)


def test_four_bumpers_have_the_names_of_the_thesis() -> None:
    assert set(Bumpers(safety_distance=1.0, count=4).names) == {
        "left",
        "right",
        "front",
        "back",
    }
    assert Bumpers(safety_distance=1.0, count=6).names[1] == "at_60"


@settings(max_examples=25)
@given(st.lists(st.floats(0, 100), min_size=1, max_size=60), st.floats(0.001, 1))
def test_quantile_is_the_range_that_a_share_of_beams_does_not_exceed(
    ranges: list[float], share: float
) -> None:
    values = np.array(ranges)
    distance = nearest_share(values, share)
    assert np.mean(values <= distance) >= share - 1e-9
    assert np.mean(values < distance) < share


def test_pressed_bumpers_are_named() -> None:
    states = Bumpers(safety_distance=1.0).read(wall_ahead(1.2))
    assert pressed_names(states) == ("front", "front_left", "front_right")


@pytest.mark.parametrize(
    "wrong",
    [
        pytest.param({"count": 3}, id="three bumpers"),
        pytest.param({"count": 37}, id="too many bumpers"),
        pytest.param({"share": 0.0}, id="no share"),
        pytest.param({"share": 1.1}, id="more than all"),
        pytest.param({"safety_distance": -1.0}, id="negative distance"),
    ],
)
def test_invalid_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="expected"):
        Bumpers(**{"safety_distance": 1.0, **wrong})  # type: ignore[arg-type]
