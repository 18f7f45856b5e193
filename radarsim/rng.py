"""Random generators: an independent stream for each seed and name.

Every robot and sensor draws from a generator keyed by the seed and its own name, so
that adding one does not change the numbers of another, and the same seed gives the
same bytes.
"""

import hashlib
from typing import Any

import numpy as np


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
