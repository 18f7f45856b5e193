"""The rows of polar images of turning radars, with the time and place of each.

A row begins with 11 bytes, as in the data sets of Oxford and Boreas, whose sources
``image_files`` names.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

ENCODER_COUNTS: Final = 5600  # in a turn
METADATA_BYTES: Final = 11
VALID: Final = 255


def put_metadata(
    counts: NDArray[np.uint8], times: NDArray[np.int64], encoder: NDArray[np.int64]
) -> NDArray[np.uint8]:
    """Return rows of Oxford's layout, (R, 11 + B).

    Args:
        counts: (R, B) what is received from each direction.
        times: (R,) us, when.
        encoder: (R,) count of the encoder at each direction.
    """
    rows = np.zeros((len(counts), METADATA_BYTES + counts.shape[1]), np.uint8)
    rows[:, :8] = times.astype("<i8").view(np.uint8).reshape(-1, 8)
    rows[:, 8:10] = encoder.astype("<u2").view(np.uint8).reshape(-1, 2)
    rows[:, 10] = VALID
    rows[:, METADATA_BYTES:] = counts
    return rows


def encoder_counts(azimuths: int) -> NDArray[np.int64]:
    """Return the encoder at each direction, (A,); 0 is straight ahead."""
    counts: NDArray[np.int64] = np.arange(azimuths) * ENCODER_COUNTS // azimuths
    return counts
