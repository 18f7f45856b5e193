"""Turns as the images that data sets of turning radars consist of.

``oxford`` and ``boreas``: 8-bit grey, a row for each direction, clockwise from straight
ahead. A row begins with 11 bytes: the time, int64 of us, and the encoder, uint16 of
5600 in a turn, both with the lowest byte first, and 255 for a valid row, in Boreas for
a sweep upwards. Its counts follow. Sources: the documentation and the kit of the Oxford
Radar RobotCar Dataset; DATA_REFERENCE.md and utils/radar.py of pyboreas.

``radiate``: a column for each direction and a row for each range, without times; and
the same turn from above, 1152 x 1152 pixels, straight ahead up. Its files are PNG, but
their pixels have been through JPEG of quality 80, as those of the published ones show:
blocks of 8 x 8 pixels, and cosines that are multiples of the standard table's steps.
Sources: the kit and images of the RADIATE data set.

Readers of Oxford's and Boreas' images sort the names of files, which are times, as
text. So times that have fewer digits than those of today are counted from an epoch.
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


# The folder in which each data set has its images, and the files that list them.
LAYOUTS: Final[dict[str, tuple[str, ...]]] = {
    "oxford": ("radar", "radar.timestamps"),
    "boreas": ("radar", "radar.timestamps"),
    "radiate": ("Navtech_Polar", "Navtech_Polar.txt", "Navtech_Cartesian.txt"),
}
_FASTEST: Final = 1  # of the levels of compression

LEAST_TIME_US: Final = 10**15  # from which on times have as many digits as today's
EPOCH_US: Final = 1_600_000_000_000_000
# From here on pyboreas takes finer bins; a path with those begins after it.
BOREAS_CHANGE_US: Final = 1_632_182_400_000_000
_LATE_EPOCH_US: Final = 1_650_000_000_000_000
COARSE_BIN, FINE_BIN = 0.0596, 0.04381  # m, of pyboreas before and after
OXFORD_BIN: Final = 0.0432  # m, of the kit of the Oxford data set
RADIATE_BIN: Final = 0.173611  # m, of that of RADIATE, also the size of a pixel
CARTESIAN_SIZE: Final = 1152  # pixels
RADIATE_QUALITY: Final = 80  # of the JPEG through which its images went


def epoch_of(layout: str, bin_size: float, start_us: int) -> int:
    """Return what is added to the times of a sequence, us.

    Args:
        layout: Of which data set its images are.
        bin_size: m, of the radar.
        start_us: When the sequence begins, us.
    """
    if start_us >= LEAST_TIME_US:
        return 0
    is_fine = abs(bin_size - FINE_BIN) < abs(bin_size - COARSE_BIN)
    return _LATE_EPOCH_US if layout == "boreas" and is_fine else EPOCH_US


def assumed_bin(layout: str, time_us: int) -> float:
    """Return the size of bins that the reader of a data set assumes, m.

    Args:
        layout: Of which data set.
        time_us: Time at which the sequence begins, us.
    """
    if layout == "boreas":
        return FINE_BIN if time_us > BOREAS_CHANGE_US else COARSE_BIN
    return {"oxford": OXFORD_BIN, "radiate": RADIATE_BIN}[layout]


def sequence_notes(
    layout: str, spectrum: Spectrum, start_us: int, epoch_us: int
) -> str:
    """Return the text of the file README.md of a sequence.

    Args:
        layout: Of which data set its images are.
        spectrum: Its first turn.
        start_us: When it begins, with the epoch, us.
        epoch_us: What was added to times, us.
    """
    images, names = LAYOUTS[layout][:2]
    settings = spectrum.settings
    lines = [
        f"# Turns of {spectrum.sensor}, simulated by radarsim\n",
        f"- `{images}` has images as in the data set `{layout}`, and `{names}`"
        " lists them.",
        f"- {settings.azimuths} directions of {settings.bins} bins of"
        f" {settings.bin_size:g} m.",
        f"- Readers of this data set assume bins of"
        f" {assumed_bin(layout, start_us):g} m.",
        "- `poses.tum` has the true pose of the antenna in the middle of each turn.",
    ]
    if epoch_us:
        seconds = epoch_us // 1_000_000
        lines.append(f"- {seconds} s were added to the times of the path.")
    return "\n".join(lines) + "\n"


def through_jpeg(counts: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return counts, (A, B), as images of RADIATE have them."""
    data = io.BytesIO()
    columns = Image.fromarray(np.ascontiguousarray(counts.T))
    columns.save(data, "JPEG", quality=RADIATE_QUALITY)
    with Image.open(data) as image:
        return np.asarray(image).T


def cartesian_image(spectrum: Spectrum) -> bytes:
    """Return a turn from above as a PNG file, as RADIATE has it."""
    from scipy.ndimage import map_coordinates  # noqa: PLC0415 - slow

    settings = spectrum.settings
    across = (np.arange(CARTESIAN_SIZE) - (CARTESIAN_SIZE - 1) / 2) * RADIATE_BIN
    right, ahead = across[None, :], -across[:, None]
    row = np.remainder(np.arctan2(right, ahead), 2 * np.pi) / settings.step
    places = np.stack([row, np.hypot(right, ahead) / settings.bin_size])
    counts = through_jpeg(spectrum.counts)
    # After the last direction comes the first one again.
    turn = np.concatenate([counts, counts[:1]]).astype(np.float32)
    pixels = map_coordinates(turn, places, order=1, cval=0.0)
    return _as_png(np.rint(pixels).astype(np.uint8))


def _as_png(pixels: NDArray[np.uint8]) -> bytes:
    data = io.BytesIO()
    Image.fromarray(pixels).save(data, "PNG", compress_level=_FASTEST)
    return data.getvalue()


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
        pixels = np.ascontiguousarray(through_jpeg(spectrum.counts).T)
    else:
        encoder = encoder_counts(len(spectrum.angles))
        times = row_times(spectrum, time_us)
        pixels = put_metadata(spectrum.counts, times, encoder)
    return _as_png(pixels)


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
