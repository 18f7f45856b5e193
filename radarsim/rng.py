"""Random generators: an independent stream for each seed and name.

Every robot and sensor draws from a generator keyed by the seed and its own name, so
that adding one does not change the numbers of another, and the same seed gives the
same bytes.
"""

import hashlib
import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_BITS: Final = 32  # of a normal number
_PERIOD: Final = 2**128  # of PCG64
# Steps from one stream to the next, the golden ratio of the period, as numpy's
# ``PCG64.jumped``. By a multiple of a power of two the lower half of the state would be
# the same in all streams, and their numbers correlated.
_STRIDE: Final = 0x9E3779B97F4A7C15F39CC0605CEDC835


def generator_for(seed: int, *names: str) -> np.random.Generator:
    """Create the generator of a seed and names.

    Args:
        seed: The run's seed, at least 0.
        names: Names that identify the user, such as ``"R1", "lms200"``.

    Raises:
        TypeError: If the seed is no whole number.
        ValueError: If it is negative.
    """
    text = f"seed {seed!r}, expected a whole number of at least 0"
    if not isinstance(seed, int | np.integer):
        raise TypeError(text)
    if seed < 0:
        raise ValueError(text)
    # A hash of the language differs from run to run, and names may have any characters
    # but NUL, which separates them.
    digest = hashlib.sha256("\0".join(names).encode()).digest()
    key = tuple(int.from_bytes(digest[i : i + 4], "big") for i in range(0, 16, 4))
    return np.random.Generator(
        np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key))
    )


def as_generator(
    rng: np.random.Generator | int | None, *names: str
) -> np.random.Generator | None:
    """Return a generator, or that of a seed and names; None stays None.

    Raises:
        TypeError: If it is neither.
        ValueError: If a seed is negative.
    """
    if rng is None or isinstance(rng, np.random.Generator):
        return rng
    if not isinstance(rng, int | np.integer):
        raise TypeError(f"rng {rng!r}, expected a seed or a numpy Generator")
    return generator_for(rng, *names)


def fixed_number(rng: np.random.Generator) -> int:
    """Return a number of 64 bits of a generator's seed, whatever was drawn from it.

    Args:
        rng: It is not drawn from.
    """
    seed: Any = rng.bit_generator.seed_seq
    # Children have the numbers from 0 on: none is ever as large as this.
    own = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, 2**32 - 1))
    return int(own.generate_state(1, np.uint64)[0])


class NumberedStreams:
    """Streams of random numbers by number, which can be drawn in any order.

    Each begins anew whenever it is drawn from. A normal number is the count of ones
    among 32 random bits, less its mean, over its deviation: normal as far as sums of
    several are concerned, and drawn in a third of the time.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        """Create the streams of a child of a generator.

        Args:
            rng: It is not drawn from, but spawns a child.
        """
        (child,) = rng.spawn(1)
        self._seed: Any = child.bit_generator.seed_seq

    def fill_normal(self, first: int, out: NDArray[np.float32]) -> None:
        """Fill rows with the first standard normal numbers of neighbouring streams.

        Threads may do so at once.

        Args:
            first: Number of the stream of the first row, at least 0.
            out: (N, S), each row contiguous.
        """
        bits = np.random.PCG64(self._seed)
        start = bits.state
        for number, row in enumerate(out, first):
            bits.state = start
            bits.advance(number * _STRIDE % _PERIOD)
            # Each word of 64 bits makes two numbers.
            words = bits.random_raw(-(-row.size // 2))
            ones = np.bitwise_count(words.view(np.uint32)[: row.size])
            np.subtract(ones, np.float32(_BITS / 2), out=row)
        out *= np.float32(2 / math.sqrt(_BITS))
