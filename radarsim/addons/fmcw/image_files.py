"""Turns as the images that data sets of turning radars consist of.

``oxford`` and ``boreas``: 8-bit grey, a row for each direction, clockwise from straight
ahead. A row begins with 11 bytes: the time, int64 of us, and the encoder, uint16 of
5600 in a turn, both with the lowest byte first, and 255 for a valid row, in Boreas for
a sweep upwards. Its counts follow. Sources: the documentation and the kit of the Oxford
Radar RobotCar Dataset; DATA_REFERENCE.md and utils/radar.py of pyboreas.

``radiate``: a column for each direction and a row for each range, without times.
Source: the kit of the RADIATE data set.
"""

import io
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from radarsim.addons.fmcw.spectrum import Spectrum

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


# The folder in which each data set has its images, and the file that lists them.
LAYOUTS: Final = {
    "oxford": ("radar", "radar.timestamps"),
    "boreas": ("radar", "radar.timestamps"),
    "radiate": ("Navtech_Polar", "Navtech_Polar.txt"),
}
_FASTEST: Final = 1  # of the levels of compression


def image_of(spectrum: Spectrum, layout: str, *, time_us: int = 0) -> bytes:
    """Return a turn as a PNG file.

    Args:
        spectrum: The turn.
        layout: Whose images it shall look like.
        time_us: Time at which the turn begins, us.

    Raises:
        ValueError: If there is no such layout.
    """
    if layout not in LAYOUTS:
        raise ValueError(f"layout {layout!r}, expected one of {tuple(LAYOUTS)}")
    if layout == "radiate":
        pixels = np.ascontiguousarray(spectrum.counts.T)
    else:
        encoder = encoder_counts(len(spectrum.angles))
        times = row_times(spectrum, time_us)
        pixels = put_metadata(spectrum.counts, times, encoder)
    data = io.BytesIO()
    Image.fromarray(pixels).save(data, "PNG", compress_level=_FASTEST)
    return data.getvalue()


def row_times(spectrum: Spectrum, time_us: int) -> NDArray[np.int64]:
    """Return when each row was recorded, (A,) us."""
    sweep_us = 1e6 * spectrum.settings.sweep_time
    elapsed = np.rint(np.arange(len(spectrum.angles)) * sweep_us)
    times: NDArray[np.int64] = elapsed.astype(np.int64) + time_us
    return times


def file_name(spectrum: Spectrum, layout: str, *, time_us: int, number: int) -> str:
    """Return the name that a file of a data set has.

    Args:
        spectrum: The turn.
        layout: Of which data set.
        time_us: Time at which the turn begins, us; the name of Oxford's files. That of
            Boreas' is the time in the middle.
        number: Number of the turn, from 1; the name of RADIATE's files.
    """
    if layout == "radiate":
        return f"{number:06d}.png"
    if layout == "boreas":
        time_us = int(row_times(spectrum, time_us)[len(spectrum.angles) // 2 - 1])
    return f"{time_us}.png"


def list_line(layout: str, name: str, time_us: int) -> str:
    """Return the line of an image in that file.

    Args:
        layout: Of which data set.
        name: Name of the image's file.
        time_us: Time at which the turn begins, us.
    """
    stem = name.removesuffix(".png")
    if layout == "radiate":
        seconds, rest = divmod(time_us, 1_000_000)
        return f"Frame: {stem} Time: {seconds}.{rest:06d}000\n"
    return f"{stem} 1\n"  # valid
