"""Encoders of films: frames in, a file out, one frame after the other.

No encoder keeps more than two frames, however long the film is.
"""

from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, Final, Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import GifImagePlugin, Image

Pixels = NDArray[np.uint8]  # (H, W, 3)

FRAME_RATE: Final = 10  # frames per second of film
FILM_FORMATS: Final = ("gif", "mp4")
_COLOURS: Final = 255  # of a GIF frame
_UNCHANGED: Final = 255  # index of pixels that stay as they are
_QUALITY: Final = 8.0  # of 10
_HEAD: Final = 1 << 16  # bytes at the beginning of an MP4 file that list its contents


class FilmEncoder(Protocol):
    """Writes a film, frame by frame."""

    def add(self, pixels: Pixels) -> None:
        """Add a frame, (H, W, 3), which is shown for 1 / FRAME_RATE s."""


def film_format(path: Path) -> str:
    """Return the format of a film by its name, one of ``FILM_FORMATS``.

    Raises:
        ValueError: If the name has another ending, or the format needs a package that
            is not installed.
    """
    suffix = path.suffix.lower().lstrip(".")
    if suffix not in FILM_FORMATS:
        raise ValueError(f"{str(path)!r}, expected a .gif or .mp4 file")
    if suffix == "mp4":
        try:
            import imageio_ffmpeg  # noqa: PLC0415 - 165 MB, so it is optional

            imageio_ffmpeg.get_ffmpeg_exe()
        except (ImportError, RuntimeError):
            cure = "pip install 'radarsim[film]'"
            name = path.with_suffix(".gif")
            text = f"MP4 films need ffmpeg, expected {cure}, or --film {name}"
            raise ValueError(text) from None
    return suffix


@contextmanager
def open_encoder(path: Path, form: str, size: tuple[int, int]) -> Iterator[FilmEncoder]:
    """Write a film; it is complete when the context is left without an error.

    Args:
        path: The file to be written.
        form: One of ``FILM_FORMATS``.
        size: Width and height of the frames, pixels; even numbers.

    Raises:
        OSError: If the film cannot be written.
    """
    if form == "gif":
        with path.open("wb") as file:
            gif = GifEncoder(file)
            yield gif
            gif.finish()
        return
    encoder = Mp4Encoder(path, size)
    try:
        yield encoder
    finally:
        encoder.close()
    with path.open("rb") as file:
        is_complete = b"moov" in file.read(_HEAD)
    if not is_complete:
        raise OSError("ffmpeg could not complete the film")


class GifEncoder:
    """Writes a GIF that repeats; a frame holds only what has changed since the last."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._shown: Pixels | None = None  # the latest frame
        self._waiting: tuple[Image.Image, tuple[int, int]] | None = None
        self._times = 0  # how often the latest frame was added

    def add(self, pixels: Pixels) -> None:
        """Add a frame."""
        if self._shown is None:
            changed = np.ones(pixels.shape[:2], np.bool_)
            self._start(pixels)
        else:
            changed = (pixels != self._shown).any(axis=2)
        if not changed.any():
            self._times += 1
            return
        self._write_waiting()
        rows, columns = (np.flatnonzero(changed.any(axis=axis)) for axis in (1, 0))
        window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        indexed = _quantised(pixels[window])
        cells = np.array(indexed)
        cells[~changed[window]] = _UNCHANGED
        indexed.paste(Image.fromarray(cells, "L"))
        self._waiting = indexed, (int(columns[0]), int(rows[0]))
        self._shown, self._times = pixels.copy(), 1

    def finish(self) -> None:
        """Write what is left, and the end of the file."""
        self._write_waiting()
        self._file.write(b";")

    def _start(self, pixels: Pixels) -> None:
        header, _ = GifImagePlugin.getheader(_quantised(pixels), info={"loop": 0})
        self._file.writelines(header)

    def _write_waiting(self) -> None:
        """Write the latest frame, now that it is known how long it is shown."""
        if self._waiting is None:
            return
        image, place = self._waiting
        duration = self._times * 1000 // FRAME_RATE  # ms
        blocks = GifImagePlugin.getdata(
            image,
            place,
            duration=duration,
            transparency=_UNCHANGED,
            include_color_table=True,
        )
        self._file.writelines(blocks)
        self._waiting = None


def _quantised(pixels: Pixels) -> Image.Image:
    """Return an image with at most 255 colours, exact ones if they suffice."""
    image = Image.fromarray(np.ascontiguousarray(pixels))
    return image.quantize(_COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)


class Mp4Encoder:
    """Writes an H.264 film by ffmpeg, in a process of its own."""

    def __init__(self, path: Path, size: tuple[int, int]) -> None:
        import imageio_ffmpeg  # noqa: PLC0415

        self._frames: Generator[None, Pixels | None, None]
        self._frames = imageio_ffmpeg.write_frames(
            str(path),
            size,
            fps=FRAME_RATE,
            codec="libx264",
            quality=_QUALITY,
            macro_block_size=2,
            ffmpeg_log_level="quiet",
            output_params=["-f", "mp4", "-movflags", "+faststart"],
        )
        self._frames.send(None)

    def add(self, pixels: Pixels) -> None:
        """Add a frame."""
        self._frames.send(np.ascontiguousarray(pixels))

    def close(self) -> None:
        """Let ffmpeg complete the file, and wait for it."""
        self._frames.close()
