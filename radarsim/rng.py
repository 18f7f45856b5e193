"""Random generators: an independent stream for each seed and name.

Every robot and sensor draws from a generator keyed by the seed and its own name, so
that adding one does not change the numbers of another, and the same seed gives the
same bytes.
"""

import hashlib

import numpy as np


def generator_for(seed: int, *names: str) -> np.random.Generator:
    """Create the generator of a seed and names.

    Args:
        seed: The run's seed, at least 0.
        names: Names that identify the user, such as ``"R1", "lms200"``.
    """
    digest = hashlib.sha256("\0".join(names).encode()).digest()
    key = tuple(int.from_bytes(digest[i : i + 4], "big") for i in range(0, 16, 4))
    return np.random.Generator(
        np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key))
    )
