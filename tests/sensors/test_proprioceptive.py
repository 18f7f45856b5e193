import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.errors import PresetError
from radarsim.geometry import Pose3
from radarsim.rng import generator_for
from radarsim.sensors.proprioceptive import (
    ENCODER_RESOLUTION,
    Encoder,
    Ins,
    InsNoise,
    Tachometer,
    encoded_wheels,
)

CALM = InsNoise(sigma=0, position_bias=0, angle_bias=0)
SPAWN = Pose3(1, 2, 0.146, 0, 0, 0.5)
MOUNTED = Pose3(1, 2, 0.346, 0, 0, 0.5)
places = st.builds(
    Pose3, st.floats(-9, 9), st.floats(-9, 9), st.just(0.146), yaw=st.floats(-3, 3)
)
angles = st.floats(-50, 50)


def ins(noise: InsNoise = CALM, *, seed: int = 0) -> Ins:
    return Ins(MOUNTED, SPAWN, generator_for(seed, "R1", "InsTest"), noise)


def moved(by: Sequence[float]) -> Pose3:
    """Return the body's pose after a motion from the spawn."""
    return Pose3.from_numbers(np.add(SPAWN.numbers(), by).tolist())


def close(one: Pose3, other: Pose3) -> bool:
    apart = np.subtract(one.numbers(), other.numbers())
    apart[3:] = np.arctan2(np.sin(apart[3:]), np.cos(apart[3:]))
    return bool(np.abs(apart).max() < 1e-9)


def test_ins_starts_at_the_pose_of_the_sensor() -> None:
    assert ins(InsNoise()).reading(SPAWN) == MOUNTED


@given(path=st.lists(places))
def test_ins_without_noise_keeps_its_offset_from_the_body(path: list[Pose3]) -> None:
    calm = ins()
    for body in path:
        calm.drift(body)
        above = Pose3(body.x, body.y, body.z + 0.2, yaw=body.yaw)
        assert close(calm.reading(body), above)


@given(path=st.lists(places, min_size=1))
def test_true_motion_is_added_between_drift_updates(path: list[Pose3]) -> None:
    drifting = ins(InsNoise())
    drifting.drift(moved([1, 0, 0, 0, 0, 1]))
    last = drifting.reading(moved([1, 0, 0, 0, 0, 1]))
    drift = np.subtract(last.numbers(), moved([1, 0, 0, 0, 0, 1]).numbers())
    for body in path:
        expected = Pose3.from_numbers(np.add(body.numbers(), drift).tolist())
        assert close(drifting.reading(body), expected)


def test_ins_does_not_drift_at_standstill() -> None:
    drifting = ins(InsNoise(sigma=0.5, position_bias=0.5, angle_bias=0.5))
    for _ in range(100):
        drifting.drift(SPAWN)
    assert drifting.reading(SPAWN) == MOUNTED


def test_position_deviation_is_a_fraction_of_the_distance() -> None:
    motion = [3, 4, 0, 0, 0, 0]
    errors = []
    for seed in range(2000):
        drifting = ins(InsNoise(), seed=seed)
        drifting.drift(moved(motion))
        reading = drifting.reading(moved(motion))
        errors.append(np.subtract(reading.numbers(), MOUNTED.numbers()) - motion)
    spread = np.std(errors, axis=0)
    assert spread[:3] == pytest.approx([0.25] * 3, rel=0.06)
    assert spread[3:].tolist() == [0, 0, 0]
    assert np.mean(errors, axis=0)[:3] == pytest.approx([0] * 3, abs=0.02)


def test_angle_deviation_is_a_fraction_of_the_turn() -> None:
    motion = [0, 0, 0, 0, 0, 2]
    errors = []
    for seed in range(2000):
        drifting = ins(InsNoise(), seed=seed)
        drifting.drift(moved(motion))
        errors.append(drifting.reading(moved(motion)).yaw - MOUNTED.yaw - 2)
    assert np.std(errors) == pytest.approx(0.1, rel=0.06)


def test_bias_is_constant_within_a_run_and_bounded() -> None:
    biased = InsNoise(sigma=0, position_bias=0.5, angle_bias=0.1)
    seen = []
    for seed in range(300):
        drifting = ins(biased, seed=seed)
        errors = []
        for k in range(1, 4):
            body = moved([k, 0, 0, 0, 0, k / 2])
            drifting.drift(body)
            error = np.subtract(drifting.reading(body).numbers(), body.numbers())
            errors.append(error - [0, 0, 0.2, 0, 0, 0])
        assert errors[2] == pytest.approx(3 * errors[0])
        seen.append(errors[0])
    largest = np.abs(seen).max(axis=0)
    assert largest[:3] == pytest.approx([0.5] * 3, rel=0.05)
    assert largest[5] == pytest.approx(0.05, rel=0.05)


def test_same_generator_gives_the_same_drift() -> None:
    def track(one: Ins) -> Pose3:
        for k in range(20):
            one.drift(moved([k, 0, 0, 0, 0, k / 9]))
        return one.reading(SPAWN)

    first, again = track(ins(InsNoise())), track(ins(InsNoise()))
    assert first == again
    assert first != track(ins(InsNoise(), seed=1))


def test_overwriting_sets_the_estimate_and_removes_the_bias() -> None:
    drifting = ins(InsNoise(sigma=0, position_bias=0.5, angle_bias=0.5))
    drifting.drift(moved([1, 1, 0, 0, 0, 1]))
    here = moved([2, 2, 0, 0, 0, 1])
    drifting.overwrite(Pose3(0, 0, 0), here)
    assert drifting.reading(here) == Pose3(0, 0, 0)
    there = moved([5, 6, 0, 0, 0, 1.5])
    drifting.drift(there)
    assert close(drifting.reading(there), Pose3(3, 4, 0, yaw=0.5))


def test_turn_across_180_degrees_is_the_short_one() -> None:
    calm = ins()
    calm.drift(Pose3(1, 2, 0.146, yaw=3.0))
    calm.drift(Pose3(1, 2, 0.146, yaw=-3.0))
    turned = 2.5 + 2 * math.pi - 6.0
    assert calm.reading(Pose3(1, 2, 0.146, yaw=-3.0)).yaw == pytest.approx(0.5 + turned)


def test_noise_is_read_from_settings() -> None:
    assert InsNoise.from_settings({}) == InsNoise(0.05, 0.5e-3, 0.5e-6)
    assert InsNoise.from_settings({"sigma": 0, "position_bias": 1.5}) == InsNoise(
        sigma=0, position_bias=1.5
    )


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        pytest.param(
            {"sigm": 1},
            "INS setting 'sigm', expected one of"
            " ['sigma', 'position_bias', 'angle_bias']; did you mean 'sigma'?",
            id="unknown",
        ),
        pytest.param(
            {"sigma": -1}, "INS setting sigma: -1, expected 0 to 10", id="negative"
        ),
        pytest.param(
            {"sigma": "much"},
            "INS setting sigma: 'much', expected 0 to 10",
            id="text",
        ),
        pytest.param(
            {"angle_bias": True},
            "INS setting angle_bias: True, expected 0 to 10",
            id="boolean",
        ),
        pytest.param(
            {"sigma": math.nan}, "INS setting sigma: nan, expected 0 to 10", id="nan"
        ),
        pytest.param(
            {"sigma": math.inf},
            "INS setting sigma: inf, expected 0 to 10",
            id="infinite",
        ),
    ],
)
def test_invalid_settings_are_rejected(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(PresetError) as caught:
        InsNoise.from_settings(settings)
    assert str(caught.value) == message


def test_tachometer_averages_since_its_last_reading() -> None:
    tachometer = Tachometer(10.0, (0, 0))
    reading = tachometer.read(10.2, (0.4, -0.2))
    assert reading.velocities == pytest.approx((2, -1))
    assert reading.positions == pytest.approx((0.4, -0.2))
    assert tachometer.read(10.4, (0.4, -0.2)).velocities == pytest.approx((0, 0))


def test_second_reading_at_the_same_time_repeats_the_first() -> None:
    tachometer = Tachometer(0.0, (0,))
    assert tachometer.read(0.0, (0,)).velocities == (0,)
    first = tachometer.read(0.5, (1,))
    assert tachometer.read(0.5, (1,)) == first


def test_tachometer_reset_zeroes_positions_but_not_velocities() -> None:
    tachometer = Tachometer(0.0, (0, 0))
    tachometer.read(1.0, (5, 6))
    tachometer.reset((5, 6))
    reading = tachometer.read(2.0, (6, 8))
    assert reading.positions == (1, 2)
    assert reading.velocities == (1, 2)


def encoder(name: str, *, noise: float = 0.0, seed: int = 0) -> Encoder:
    wheels = encoded_wheels(name, ("right", "left", "right", "left"))
    return Encoder(wheels, (0,) * 4, generator_for(seed, name), noise=noise)


@pytest.mark.parametrize(
    ("name", "wheels"),
    [
        pytest.param("W1", ["W1"], id="one"),
        pytest.param("EncTestW0W3", ["W0", "W3"], id="two"),
        pytest.param("W4", [], id="no such wheel"),
        pytest.param("Encoder", [], id="none"),
    ],
)
def test_encoder_counts_the_wheels_in_its_name(name: str, wheels: list[str]) -> None:
    assert [wheel for wheel, _ in encoder(name).ticks((0,) * 4)] == wheels


@pytest.mark.parametrize(
    ("angle", "ticks"),
    [
        pytest.param(0.0, 0, id="at rest"),
        pytest.param(2.5 * ENCODER_RESOLUTION, 2, id="part of a tick"),
        pytest.param(-2.5 * ENCODER_RESOLUTION, -2, id="backward"),
        pytest.param(math.pi, 180, id="half a turn"),
        pytest.param(2 * math.pi + 2.5 * ENCODER_RESOLUTION, 2, id="after a turn"),
        pytest.param(-2 * math.pi - 1, -57, id="backward after a turn"),
    ],
)
def test_ticks_without_noise(angle: float, ticks: int) -> None:
    assert encoder("W1").ticks((9, angle, 9, 9)) == (("W1", ticks),)


def test_encoder_error_is_a_fraction_of_the_angle() -> None:
    noisy = encoder("W1", noise=0.005)
    seen = [noisy.ticks((0, 3.0, 0, 0))[0][1] for _ in range(500)]
    assert min(seen) == int(3.0 * 0.995 / ENCODER_RESOLUTION)
    assert max(seen) == int(3.0 * 1.005 / ENCODER_RESOLUTION)
    assert noisy.ticks((0, 0, 0, 0)) == (("W1", 0),)


def test_encoder_counts_from_its_reset() -> None:
    counted = encoder("W2")
    counted.reset((1, 1, 1, 1))
    assert counted.ticks((1, 1, 1 + 3.5 * ENCODER_RESOLUTION, 1)) == (("W2", 3),)
