import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mountings import mounting, move, robot_at

from radarsim.errors import EngineError
from radarsim.geometry import Pose3
from radarsim.presets.robots import Item
from radarsim.rng import generator_for
from radarsim.sensors import wheels
from radarsim.sensors.ins import Ins, InsSettings
from radarsim.sensors.readings import Job
from radarsim.sensors.sensor import EngineSensor, Reading
from radarsim.sensors.wheels import ENCODER_RESOLUTION, encoded_wheels

CALM = InsSettings(sigma=0, position_bias=0, angle_bias=0)
SPAWN = Pose3(1, 2, 0.146, 0, 0, 0.5)
MOUNTED = Pose3(1, 2, 0.346, 0, 0, 0.5)
places = st.builds(
    Pose3, st.floats(-9, 9), st.floats(-9, 9), st.just(0.146), yaw=st.floats(-3, 3)
)


class Read:
    """A sensor of a robot whose pose and wheels are given.

    Attributes:
        sensor: The sensor.
    """

    def __init__(
        self,
        kind: type[EngineSensor],
        item: Item,
        noise: InsSettings | None = None,
        *,
        seed: int = 0,
    ) -> None:
        self.robot = robot_at(SPAWN)
        rng = generator_for(seed, "R1", item.name)
        mounted = mounting(item, noise, robot=self.robot, rng=rng)
        self.sensor, self.state = kind(mounted), mounted.state
        self.table = self.state.table

    def turn(self, left: float, right: float) -> None:
        """Set the angles of the wheels."""
        self.robot.row["left_angle"], self.robot.row["right_angle"] = left, right

    def read(self, jobs: Sequence[Job], size: int, ticks: int = 0) -> list[float]:
        """Do jobs, and draw what they use up."""
        program = self.table.program(jobs, size)
        numbers, is_depleted = self.table.run([(self.robot.slot, program)], ticks)
        assert self.state.is_depleted == is_depleted
        if is_depleted:
            self.state.is_depleted = False
            self.sensor.draw()
        return numbers


class ReadIns(Read):
    sensor: Ins

    def __init__(self, noise: InsSettings = CALM, *, seed: int = 0) -> None:
        item = Item(type="INS", name="InsTest", position=(0, 0, 0.2))
        super().__init__(Ins, item, noise, seed=seed)

    def drift(self, body: Pose3) -> None:
        move(self.robot, body)
        self.read([self.sensor.drift], 0)

    def reading(self, body: Pose3) -> Pose3:
        move(self.robot, body)
        return Pose3(*self.read(self.sensor.source[1]["pose"], 6))

    def overwrite(self, pose: Pose3, body: Pose3) -> None:
        move(self.robot, body)
        self.sensor.overwrite(pose)


def ins(noise: InsSettings = CALM, *, seed: int = 0) -> ReadIns:
    return ReadIns(noise, seed=seed)


def moved(by: Sequence[float]) -> Pose3:
    """Return the body's pose after a motion from the spawn."""
    return Pose3.from_numbers(np.add(SPAWN.numbers(), by).tolist())


def close(one: Pose3, other: Pose3) -> bool:
    apart = np.subtract(one.numbers(), other.numbers())
    apart[3:] = np.arctan2(np.sin(apart[3:]), np.cos(apart[3:]))
    return bool(np.abs(apart).max() < 1e-9)


def test_ins_starts_at_the_pose_of_the_sensor() -> None:
    assert ins(InsSettings()).reading(SPAWN) == MOUNTED


@given(path=st.lists(places))
def test_ins_without_noise_keeps_its_offset_from_the_body(path: list[Pose3]) -> None:
    calm = ins()
    for body in path:
        calm.drift(body)
        above = Pose3(body.x, body.y, body.z + 0.2, yaw=body.yaw)
        assert close(calm.reading(body), above)


@given(path=st.lists(places, min_size=1))
def test_true_motion_is_added_between_drift_updates(path: list[Pose3]) -> None:
    drifting = ins(InsSettings())
    drifting.drift(moved([1, 0, 0, 0, 0, 1]))
    last = drifting.reading(moved([1, 0, 0, 0, 0, 1]))
    drift = np.subtract(last.numbers(), moved([1, 0, 0, 0, 0, 1]).numbers())
    for body in path:
        expected = Pose3.from_numbers(np.add(body.numbers(), drift).tolist())
        assert close(drifting.reading(body), expected)


def test_ins_does_not_drift_at_standstill() -> None:
    drifting = ins(InsSettings(sigma=0.5, position_bias=0.5, angle_bias=0.5))
    for _ in range(100):
        drifting.drift(SPAWN)
    assert drifting.reading(SPAWN) == MOUNTED


def test_position_deviation_is_a_fraction_of_the_distance() -> None:
    motion = [3, 4, 0, 0, 0, 0]
    errors = []
    for seed in range(2000):
        drifting = ins(InsSettings(), seed=seed)
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
        drifting = ins(InsSettings(), seed=seed)
        drifting.drift(moved(motion))
        errors.append(drifting.reading(moved(motion)).yaw - MOUNTED.yaw - 2)
    assert np.std(errors) == pytest.approx(0.1, rel=0.06)


def test_bias_is_constant_within_a_run_and_bounded() -> None:
    biased = InsSettings(sigma=0, position_bias=0.5, angle_bias=0.1)
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
    def track(one: ReadIns) -> Pose3:
        for k in range(20):
            one.drift(moved([k, 0, 0, 0, 0, k / 9]))
        return one.reading(SPAWN)

    first, again = track(ins(InsSettings())), track(ins(InsSettings()))
    assert first == again
    assert first != track(ins(InsSettings(), seed=1))


def test_overwriting_sets_the_estimate_and_removes_the_bias() -> None:
    drifting = ins(InsSettings(sigma=0, position_bias=0.5, angle_bias=0.5))
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


def test_drift_draws_the_same_numbers_however_many_at_a_time() -> None:
    drifting = ins(InsSettings(sigma=1, position_bias=0, angle_bias=0), seed=5)
    rng = generator_for(5, "R1", "InsTest")
    rng.uniform(-1.0, 1.0, 6)  # the bias
    for k in range(1, 50):
        before = drifting.reading(moved([k - 1, 0, 0, 0, 0, 0]))
        drifting.drift(moved([k, 0, 0, 0, 0, 0]))
        after = drifting.reading(moved([k, 0, 0, 0, 0, 0]))
        errors = np.add(rng.standard_normal(6)[:3], (1, 0, 0))
        step = np.subtract(after.numbers(), before.numbers())[:3]
        assert step == pytest.approx(errors)


def tachometer() -> Read:
    return Read(wheels.Tachometer, Item(type="Tachometer", name="Tachometer"))


def speeds(one: Read, ticks: int, angles: tuple[float, float]) -> list[float]:
    one.turn(*angles)
    right, left, *_ = one.read(one.sensor.source[1]["velocities"], 4, ticks)
    return [left, right]


def angles(one: Read, wheels: tuple[float, float]) -> list[float]:
    one.turn(*wheels)
    right, left, *_ = one.read(one.sensor.source[1]["positions"], 4)
    return [left, right]


def test_tachometer_averages_since_its_last_reading() -> None:
    measuring = tachometer()
    assert speeds(measuring, 20, (0.4, -0.2)) == pytest.approx([2, -1])
    assert angles(measuring, (0.4, -0.2)) == [0.4, -0.2]
    assert speeds(measuring, 40, (0.4, -0.2)) == [0, 0]


def test_second_reading_at_the_same_time_repeats_the_first() -> None:
    measuring = tachometer()
    assert speeds(measuring, 0, (0, 0)) == [0, 0]
    first = speeds(measuring, 50, (1, 2))
    assert speeds(measuring, 50, (1, 2)) == first == [2, 4]


def test_tachometer_zero_moves_positions_but_not_velocities() -> None:
    measuring = tachometer()
    speeds(measuring, 100, (5, 6))
    measuring.sensor.reset()
    assert speeds(measuring, 200, (6, 8)) == [1, 2]
    assert angles(measuring, (6, 8)) == [1, 2]


class Encoder(Read):
    def __init__(self, noise: float = 0.0) -> None:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(wheels, "ENCODER_NOISE", noise)
            super().__init__(wheels.Encoder, Item(type="Encoder", name="W1"))

    def ticks(self, left: float, right: float = 0.0) -> float:
        """Return the ticks of a left wheel."""
        self.turn(left, right)
        (ticks,) = self.read(self.sensor.source[1]["ticks"], 1)
        return ticks


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
    assert Encoder().ticks(angle, 9) == ticks


def test_encoder_error_is_a_fraction_of_the_angle() -> None:
    noisy = Encoder(0.005)
    seen = [noisy.ticks(3.0) for _ in range(500)]
    assert min(seen) == int(3.0 * 0.995 / ENCODER_RESOLUTION)
    assert max(seen) == int(3.0 * 1.005 / ENCODER_RESOLUTION)
    assert noisy.ticks(0) == 0


def test_encoder_draws_the_same_errors_however_many_at_a_time() -> None:
    noisy, rng = Encoder(0.5), generator_for(0, "R1", "W1")
    for _ in range(50):
        ticks = int(3.0 * (1 + rng.uniform(-0.5, 0.5)) / ENCODER_RESOLUTION)
        assert noisy.ticks(3.0) == ticks


def test_encoder_counts_from_its_reset() -> None:
    counted = Encoder()
    counted.turn(1, 0)
    counted.sensor.reset()
    assert counted.ticks(1 + 3.5 * ENCODER_RESOLUTION) == 3


@pytest.mark.parametrize("size", [0, 2])
def test_jobs_have_to_write_the_numbers_of_their_lines(size: int) -> None:
    table = tachometer().table
    with pytest.raises(EngineError, match=f"^expected jobs that write {size} numbers"):
        table.run([(0, table.program([Job(Reading.TIME)], size))], 0)


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
    counted = encoded_wheels(name, ("right", "left", "right", "left"))
    assert [wheel for wheel, *_ in counted] == wheels
