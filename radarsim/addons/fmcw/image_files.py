"""Writes and reads revolutions as images in the file formats of radar data sets.

``oxford`` and ``boreas``: 8-bit greyscale images with a row for each azimuth, clockwise
from straight ahead. A row begins with 11 bytes: the time in us, int64; the encoder,
uint16, with 5600 counts per revolution, both little-endian; and 255 for a valid row (in
Boreas for an upward sweep). The counts follow. Sources: the documentation and the
development kit of the Oxford Radar RobotCar Dataset; DATA_REFERENCE.md and
utils/radar.py of pyboreas.

``radiate``: images with a column for each azimuth and a row for each range, without
times; and the same revolution from above, 1152 x 1152 pixels, straight ahead up. The
files are PNG, but their pixels were compressed by JPEG with quality 80 before, as the
published images show: their blocks of 8 x 8 pixels have DCT coefficients that are
multiples of the standard quantisation table. Sources: the development kit and images of
the RADIATE data set.

Readers of Oxford's and Boreas' images sort file names, which are times, as text. So an
epoch is added to times that have fewer digits than today's.
"""

import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from radarsim.addons.fmcw.spectrum import Spectrum
from radarsim.geometry import Floats

ENCODER_COUNTS: Final = 5600  # counts per revolution
METADATA_BYTES: Final = 11
VALID: Final = 255


def put_metadata(
    counts: NDArray[np.uint8], times: NDArray[np.int64], encoder: NDArray[np.int64]
) -> NDArray[np.uint8]:
    """Return counts as image rows in the layout of the Oxford data set, (R, 11 + B).

    Args:
        counts: Counts of each azimuth, (R, B).
        times: Times of the azimuths, (R,) us.
        encoder: Encoder counts of the azimuths, (R,).
    """
    rows = np.zeros((len(counts), METADATA_BYTES + counts.shape[1]), np.uint8)
    rows[:, :8] = times.astype("<i8").view(np.uint8).reshape(-1, 8)
    rows[:, 8:10] = encoder.astype("<u2").view(np.uint8).reshape(-1, 2)
    rows[:, 10] = VALID
    rows[:, METADATA_BYTES:] = counts
    return rows


def encoder_counts(azimuths: int) -> NDArray[np.int64]:
    """Return the encoder count of each azimuth, (A,), which is 0 straight ahead."""
    counts: NDArray[np.int64] = np.arange(azimuths) * ENCODER_COUNTS // azimuths
    return counts


# For each data set: the folder of its images, and the files that list these images.
LAYOUTS: Final[dict[str, tuple[str, ...]]] = {
    "oxford": ("radar", "radar.timestamps"),
    "boreas": ("radar", "radar.timestamps"),
    "radiate": ("Navtech_Polar", "Navtech_Polar.txt", "Navtech_Cartesian.txt"),
}
_FASTEST: Final = 1  # compression level of PNG files

LEAST_TIME_US: Final = 10**15  # the least time with 16 digits, like current times
EPOCH_US: Final = 1_600_000_000_000_000
# For data after this time, the library pyboreas assumes fine bins, so sequences with
# fine bins begin later.
BOREAS_CHANGE_US: Final = 1_632_182_400_000_000
_LATE_EPOCH_US: Final = 1_650_000_000_000_000
COARSE_BIN, FINE_BIN = 0.0596, 0.04381  # m, bins in pyboreas before and after that time
OXFORD_BIN: Final = 0.0432  # m, bins in the kit of the Oxford data set
RADIATE_BIN: Final = 0.173611  # m, bins and pixels in the kit of RADIATE
RADIATE_HZ: Final = 4.0  # revolutions per second
CARTESIAN_SIZE: Final = 1152  # pixels
RADIATE_QUALITY: Final = 80  # JPEG quality of the images


def epoch_of(layout: str, bin_size: float, start_us: int) -> int:
    """Return the offset, us, that is added to the times of a sequence.

    Args:
        layout: Name of the data set.
        bin_size: Distance between range bins of the radar, m.
        start_us: Time at which the sequence begins, us.
    """
    if start_us >= LEAST_TIME_US:
        return 0
    is_fine = abs(bin_size - FINE_BIN) < abs(bin_size - COARSE_BIN)
    return _LATE_EPOCH_US if layout == "boreas" and is_fine else EPOCH_US


def assumed_bin(layout: str, time_us: int) -> float:
    """Return the bin size, m, that the reader library of a data set assumes.

    Args:
        layout: Name of the data set.
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
        layout: Name of the data set.
        spectrum: The first revolution of the sequence.
        start_us: Time at which it begins, with the epoch, us.
        epoch_us: The epoch that was added to times, us.
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
    """Compress counts as JPEG, as in RADIATE, and return the changed counts, (A, B)."""
    data = io.BytesIO()
    columns = Image.fromarray(np.ascontiguousarray(counts.T))
    columns.save(data, "JPEG", quality=RADIATE_QUALITY)
    with Image.open(data) as image:
        return np.asarray(image).T


def cartesian_image(spectrum: Spectrum) -> bytes:
    """Return a revolution, seen from above, as a PNG file in the format of RADIATE."""
    from scipy.ndimage import map_coordinates  # noqa: PLC0415 - slow

    settings = spectrum.settings
    across = (np.arange(CARTESIAN_SIZE) - (CARTESIAN_SIZE - 1) / 2) * RADIATE_BIN
    right, ahead = across[None, :], -across[:, None]
    row = np.remainder(np.arctan2(right, ahead), 2 * np.pi) / settings.step
    places = np.stack([row, np.hypot(right, ahead) / settings.bin_size])
    counts = through_jpeg(spectrum.counts)
    # The first azimuth is appended to allow interpolation between the last and the
    # first azimuth.
    turn = np.concatenate([counts, counts[:1]]).astype(np.float32)
    pixels = map_coordinates(turn, places, order=1, cval=0.0)
    return _as_png(np.rint(pixels).astype(np.uint8))


def _as_png(pixels: NDArray[np.uint8]) -> bytes:
    data = io.BytesIO()
    Image.fromarray(pixels).save(data, "PNG", compress_level=_FASTEST)
    return data.getvalue()


def image_of(spectrum: Spectrum, layout: str, *, time_us: int = 0) -> bytes:
    """Return a revolution as a PNG file in the format of a data set.

    Args:
        spectrum: The revolution.
        layout: Name of the data set whose format is used.
        time_us: Time at which the revolution begins, us.

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
    """Return the time at which each azimuth of a revolution was recorded, (A,) us."""
    sweep_us = 1e6 * spectrum.settings.sweep_time
    elapsed = np.rint(np.arange(len(spectrum.angles)) * sweep_us)
    times: NDArray[np.int64] = elapsed.astype(np.int64) + time_us
    return times


def file_name(spectrum: Spectrum, layout: str, *, time_us: int, number: int) -> str:
    """Return the file name of an image in a data set.

    Args:
        spectrum: The revolution.
        layout: Name of the data set.
        time_us: Time at which the revolution begins, us. Oxford's files are named after
            this time, Boreas' files after the time in the middle.
        number: Number of the revolution, from 1; RADIATE's files are named after it.
    """
    if layout == "radiate":
        return f"{number:06d}.png"
    if layout == "boreas":
        time_us = int(row_times(spectrum, time_us)[len(spectrum.angles) // 2 - 1])
    return f"{time_us}.png"


def list_line(layout: str, name: str, time_us: int) -> str:
    """Return the line for an image in the file that lists the images.

    Args:
        layout: Name of the data set.
        name: Name of the image's file.
        time_us: Time at which the revolution begins, us.
    """
    stem = name.removesuffix(".png")
    if layout == "radiate":
        seconds, rest = divmod(time_us, 1_000_000)
        return f"Frame: {stem} Time: {seconds}.{rest:06d}000\n"
    return f"{stem} 1\n"  # 1 means a valid image


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RadarTurn:
    """The data of a revolution of an FMCW radar: A azimuths with B range bins.

    Attributes:
        times: Simulated times, or times of the data set, (A,) s.
        angles: Azimuths, (A,) rad, counter-clockwise from straight ahead. The radar
            rotates clockwise, so they fall from 0 to -2 pi.
        ranges: Ranges of the bins, (B,) m.
        counts: The power as the radar stores it, (A, B) uint8.
        frame: Frame of the radar, or the name of the image.
    """

    times: Floats
    angles: Floats
    ranges: Floats
    counts: NDArray[np.uint8]
    frame: str

    def __repr__(self) -> str:
        azimuths, bins = self.counts.shape
        return f"<RadarTurn {self.frame}: {azimuths} azimuths of {bins} bins>"

    @classmethod
    def of(
        cls,
        rows: NDArray[np.uint8],
        bin_size: float,
        frame: str,
        metadata_bytes: int = METADATA_BYTES,
    ) -> Self:
        """Create a revolution from image rows in the layout of the Oxford data set.

        Args:
            rows: Rows of the image, (A, metadata_bytes + B).
            bin_size: Distance between range bins, m.
            frame: Frame of the radar, or the name of the image.
            metadata_bytes: Number of bytes in a row before the counts.
        """
        head, counts = np.split(rows, [metadata_bytes], axis=1)
        # The columns are copied, since views of another type need contiguous bytes.
        times = head[:, :8].copy().view("<i8")[:, 0]
        encoder = head[:, 8:10].copy().view("<u2")[:, 0]
        angles = -2 * np.pi / ENCODER_COUNTS * encoder
        ranges = bin_size * np.arange(float(counts.shape[1]))
        return cls(times / 1e6, angles, ranges, counts, frame)


def load_turns(
    folder: Path | str, layout: str, *, bin_size: float | None = None
) -> Iterator[RadarTurn]:
    """Yield the revolutions in a data set or an output of ``radarsim spectrum --path``.

    Images of RADIATE have no times for azimuths. Their azimuths get evenly spaced
    times, from the time of the image over the median interval between images.

    Args:
        folder: The folder that contains ``radar`` or ``Navtech_Polar``.
        layout: ``oxford``, ``boreas`` or ``radiate``.
        bin_size: Distance between range bins, m; None for the size in a ``README.md``
            of radarsim, or otherwise the size that the data set's reader assumes.

    Raises:
        ValueError: If the layout is unknown, or an image or its time is missing.
        OSError: If a file cannot be read.
    """
    if layout not in LAYOUTS:
        raise ValueError(f"layout {layout!r}, expected one of {tuple(LAYOUTS)}")
    images, list_name = (Path(folder) / name for name in LAYOUTS[layout][:2])
    files, notes = sorted(images.glob("*.png")), Path(folder) / "README.md"
    if not files:
        raise ValueError(f"{images}: no .png files, expected images of {layout!r}")
    if bin_size is None and notes.exists():
        found = re.search(r"bins of (\d+\.?\d*) m", notes.read_text("utf-8"))
        bin_size = float(found[1]) if found else None
    is_radiate = layout == "radiate"
    frame_times = _frame_times(list_name, files) if is_radiate else np.zeros(0)
    period = np.median(np.diff(frame_times)) if len(frame_times) > 1 else 1 / RADIATE_HZ
    for number, path in enumerate(files):
        with Image.open(path) as image:
            rows = np.asarray(image.convert("L"))
        if is_radiate:
            shares = np.arange(rows.shape[1]) / rows.shape[1]
            times = np.rint((frame_times[number] + period * shares) * 1e6)
            encoder = encoder_counts(rows.shape[1])
            rows = put_metadata(rows.T, times.astype(np.int64), encoder)
        size = bin_size or assumed_bin(layout, int(path.stem))
        yield RadarTurn.of(rows, size, path.stem)


def _frame_times(list_name: Path, files: list[Path]) -> Floats:
    """Return the times of images, s, from lines such as ``Frame: 000001 Time: 1.0``.

    Raises:
        ValueError: If there is no line for an image.
    """
    lines = list_name.read_text("utf-8").splitlines()
    times = {words[1]: float(words[3]) for words in map(str.split, lines) if words[3:]}
    for path in files:
        if path.stem not in times:
            raise ValueError(f"{list_name}: no line for the image {path.name}")
    return np.array([times[path.stem] for path in files])
