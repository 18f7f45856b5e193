"""Random generators: an independent stream for each seed and name.

Each robot and sensor has a generator that depends on the seed and its own name only. So
adding a sensor does not change the random numbers of others, and the same seed gives
the same bytes.
"""

import hashlib
from typing import Any

import numpy as np


def generator_for(seed: int, *names: str) -> np.random.Generator:
    """Create the random generator for a seed and names.

    Args:
        seed: The run's seed, at least 0.
        names: Names that identify the stream, such as ``"R1", "lms200"``.

    Raises:
        TypeError: If the seed is not a whole number.
        ValueError: If the seed is negative.
    """
    text = f"seed {seed!r}, expected a whole number of at least 0"
    if not isinstance(seed, int | np.integer):
        raise TypeError(text)
    if seed < 0:
        raise ValueError(text)
    # SHA-256 is used, since Python's hash() differs from run to run. NUL separates the
    # names, since no name can contain it.
    digest = hashlib.sha256("\0".join(names).encode()).digest()
    key = tuple(int.from_bytes(digest[i : i + 4], "big") for i in range(0, 16, 4))
    return np.random.Generator(
        np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key))
    )


def as_generator(
    rng: np.random.Generator | int | None, *names: str
) -> np.random.Generator | None:
    """Convert a seed and names to a generator; return a generator or None unchanged.

    Raises:
        TypeError: If the argument is neither a generator nor a seed.
        ValueError: If a seed is negative.
    """
    if rng is None or isinstance(rng, np.random.Generator):
        return rng
    if not isinstance(rng, int | np.integer):
        raise TypeError(f"rng {rng!r}, expected a seed or a numpy Generator")
    return generator_for(rng, *names)


def fixed_number(rng: np.random.Generator) -> int:
    """Return a 64-bit number that depends only on the seed of a generator.

    Args:
        rng: The generator; its state is not used or changed.
    """
    seed: Any = rng.bit_generator.seed_seq
    # Spawned generators have the keys 0, 1 and so on, so no spawned generator has the
    # key 2**32 - 1.
    own = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, 2**32 - 1))
    return int(own.generate_state(1, np.uint64)[0])
