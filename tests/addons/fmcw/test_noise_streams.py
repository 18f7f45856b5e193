"""Streams of noise: numpy's generator, and the distribution of the numbers."""

import math
from typing import Any

import numpy as np
import pytest

from radarsim.addons.fmcw.beat_signal import NumberedStreams
from radarsim.rng import generator_for

STRIDE = 0x9E3779B97F4A7C15F39CC0605CEDC835  # of the golden ratio of 2**128


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


@pytest.mark.parametrize("count", [0, 1, 2, 7, 1001])
def test_numbers_count_the_ones_of_the_words_of_numpys_generator(count: int) -> None:
    rows = np.zeros((3, count), np.float32)
    NumberedStreams(generator_for(3)).fill_normal(399, rows)
    (child,) = generator_for(3).spawn(1)
    seed: Any = child.bit_generator.seed_seq
    for number, row in enumerate(rows, 399):
        bits = np.random.PCG64(seed)
        bits.advance(number * STRIDE % 2**128)
        halves = bits.random_raw(count).view(np.uint32)[:count]
        ones = np.array([int(half).bit_count() for half in halves])
        assert row == pytest.approx((ones - 16) / math.sqrt(8), abs=1e-6)
