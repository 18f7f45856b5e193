import math

import numpy as np
import pytest

from radarsim.rng import NumberedStreams, fixed_number, generator_for


def numbers(*key: int | str) -> list[float]:
    seed, *names = key
    rng = generator_for(int(seed), *(str(name) for name in names))
    return [float(number) for number in rng.random(8)]


def test_same_seed_and_names_give_the_same_numbers() -> None:
    assert numbers(3, "R1", "lms200") == numbers(3, "R1", "lms200")


def test_other_seed_or_name_gives_other_numbers() -> None:
    keys = [(3, "R1", "lms200"), (4, "R1", "lms200"), (3, "R2", "lms200")]
    keys += [(3, "R1", "Hokuyo"), (3, "R1lms", "200")]
    assert len({tuple(numbers(*key)) for key in keys}) == len(keys)


def test_fixed_number_is_that_of_the_seed_whatever_is_drawn() -> None:
    drawn_from, fresh = generator_for(0, "a"), generator_for(0, "a")
    drawn_from.random(3)
    drawn_from.spawn(2)
    assert fixed_number(drawn_from) == fixed_number(fresh) < 2**64
    assert drawn_from.random() == fresh.random(4)[3]
    others = [generator_for(1, "a"), generator_for(0, "b"), *fresh.spawn(2)]
    assert len({fixed_number(each) for each in (fresh, *others)}) == 5


def drawn(streams: NumberedStreams, number: int, count: int) -> np.ndarray:
    numbers = np.zeros(count, np.float32)
    streams.fill_normal(number, numbers[None])
    return numbers


def test_streams_are_the_same_in_any_order_and_length() -> None:
    streams = NumberedStreams(generator_for(0))
    first, second = (drawn(streams, number, 9) for number in (0, 1))
    assert (drawn(streams, 1, 5) == second[:5]).all()
    assert (drawn(streams, 0, 9) == first).all()
    assert (first != second).any()


def test_numbers_of_streams_have_the_moments_of_normal_ones() -> None:
    streams = NumberedStreams(generator_for(1))
    numbers = np.array([drawn(streams, k, 2001) for k in range(400)], np.float64)
    assert numbers.mean() == pytest.approx(0, abs=0.01)
    assert numbers.std() == pytest.approx(1, abs=0.01)
    # Sums of ten: a kurtosis of 3.
    sums = numbers[:, :2000].reshape(-1, 10).sum(axis=1) / math.sqrt(10)
    assert (sums**4).mean() == pytest.approx(3, abs=0.15)
    assert abs(np.corrcoef(numbers[:-1].ravel(), numbers[1:].ravel())[0, 1]) < 0.01


def test_numbers_at_the_same_place_in_many_streams_are_independent() -> None:
    streams = NumberedStreams(generator_for(2))
    numbers = np.array([drawn(streams, k, 500) for k in range(2000)], np.float64)
    # Of independent ones the means have a variance of 1 / 2000.
    assert 2000 * (numbers.mean(axis=0) ** 2).mean() == pytest.approx(1, abs=0.25)
