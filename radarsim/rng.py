"""Random generators: one seed, one independent stream for every name.

A robot or sensor draws from a generator keyed by the seed and by its own name, so
that adding one changes no other one's numbers, and the same seed gives the same bytes.
"""

import hashlib

import numpy as np


def generator_for(seed: int, *names: str) -> np.random.Generator:
    """Make the generator of one named thing.

    Args:
        seed: The run's seed, at least 0.
        names: What tells the thing from all others, such as ``"R1", "lms200"``.
    """
    digest = hashlib.sha256("\0".join(names).encode()).digest()
    key = tuple(int.from_bytes(digest[i : i + 4], "big") for i in range(0, 16, 4))
    return np.random.Generator(
        np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key))
    )
