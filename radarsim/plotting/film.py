"""Films of runs: frames at a fixed rate of simulated time, encoded during the run.

A run calls ``Film.update`` after each scan. The film draws a frame when the next frame
is due, and encodes it in a separate thread. If a run is interrupted, the film shows the
run up to the interrupt.

An encoder keeps at most two frames in memory, however long the film is.
"""

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import Empty, Queue
from typing import Any, BinaryIO, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import GifImagePlugin, Image

from radarsim.errors import install_command
from radarsim.files import written_atomically

Pixels = NDArray[np.uint8]  # (H, W, 3)
AddFrame = Callable[[Pixels], object]

FRAME_RATE: Final = 10  # frames per second of film
FILM_FORMATS: Final = ("gif", "mp4")
_COLOURS: Final = 255  # maximum number of colours in a GIF frame
_UNCHANGED: Final = 255  # colour index of pixels that do not change
_QUALITY: Final = 8.0  # quality of MP4 films, out of 10
_HEAD: Final = 1 << 16  # bytes at the beginning of an MP4 file that list its contents
SPEED: Final = 6.0  # simulated seconds per second of film
HOLD: Final = 2.0  # s for which the last frame is shown
_AHEAD: Final = 4  # maximum number of frames in the queue of the encoder
_LONGEST_GAP: Final = 20  # maximum number of times that a frame is repeated
_PATIENCE: Final = 10.0  # s to wait for the encoder after the film is given up


def film_format(path: Path) -> str:
    """Return the film format for the suffix of a file name; see ``FILM_FORMATS``.

    Raises:
        ValueError: If the name has another ending, or the format needs a package that
            is not installed.
    """
    suffix = path.suffix.lower().lstrip(".")
    if suffix not in FILM_FORMATS:
        raise ValueError(f"{str(path)!r}, expected a .gif or .mp4 file")
    if suffix == "mp4":
        try:
            import imageio_ffmpeg  # noqa: PLC0415

            imageio_ffmpeg.get_ffmpeg_exe()
        except (ImportError, RuntimeError):
            hint, name = install_command("film"), path.with_suffix(".gif")
            text = f"MP4 films need ffmpeg; install it: {hint}, or choose {name}"
            raise ValueError(text) from None
    return suffix


@contextmanager
def open_encoder(path: Path, form: str, size: tuple[int, int]) -> Iterator[AddFrame]:
    """Open a film for writing; the file is complete if the context exits without error.

    Args:
        path: The file to be written.
        form: One of ``FILM_FORMATS``.
        size: Width and height of the frames in pixels, both even.

    Yields:
        A function that adds a frame, shown for 1 / FRAME_RATE s.

    Raises:
        OSError: If the film cannot be written.
    """
    if form == "gif":
        with path.open("wb") as file:
            gif = GifEncoder(file)
            yield gif.add
            gif.finish()
        return
    import imageio_ffmpeg  # noqa: PLC0415 - optional, since it has 173 MB

    frames = imageio_ffmpeg.write_frames(  # a generator that feeds a process
        str(path),
        size,
        fps=FRAME_RATE,
        codec="libx264",
        quality=_QUALITY,
        # H.264 needs even sides, which all frames have. The default of the encoder,
        # multiples of 16, would rescale the frames.
        macro_block_size=2,
        ffmpeg_log_level="quiet",
        output_params=["-f", "mp4", "-movflags", "+faststart"],
    )
    frames.send(None)
    try:
        yield lambda pixels: frames.send(np.ascontiguousarray(pixels))
    finally:
        frames.close()  # waits until ffmpeg has completed the file
    # With ``faststart``, ffmpeg moves the table of contents to the front at the very
    # end, so an incomplete file does not begin with it.
    with path.open("rb") as file:
        is_complete = b"moov" in file.read(_HEAD)
    if not is_complete:
        raise OSError("ffmpeg could not complete the film")


class GifEncoder:
    """Writes a GIF that plays forever; a frame stores only pixels that changed."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._shown: Pixels | None = None  # the latest frame
        self._waiting: tuple[Image.Image, tuple[int, int]] | None = None
        self._times = 0  # how often the latest frame was added

    def add(self, pixels: Pixels) -> None:
        """Add a frame to the film."""
        if self._shown is None:
            changed = np.ones(pixels.shape[:2], np.bool_)
            first = _quantised(pixels)
            header, _ = GifImagePlugin.getheader(first, info={"loop": 0})
            self._file.writelines(header)
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
        # Transparent pixels show the previous frame, and compress to nearly nothing.
        cells[~changed[window]] = _UNCHANGED
        indexed.paste(Image.fromarray(cells, "L"))
        # The frame is written later, since a GIF states the duration before the pixels.
        self._waiting = indexed, (int(columns[0]), int(rows[0]))
        self._shown, self._times = pixels.copy(), 1

    def finish(self) -> None:
        """Write the last frame, and complete the file."""
        self._write_waiting()
        self._file.write(b";")

    def _write_waiting(self) -> None:
        """Write the latest frame, once the time of the next frame is known."""
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
    """Return an image with at most 255 colours; unchanged if it has no more colours."""
    image = Image.fromarray(np.ascontiguousarray(pixels))
    return image.quantize(_COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)


class FrameCanvas:
    """Renders the frames of a film; artists that do not change are drawn only once."""

    def __init__(self, figure: Figure) -> None:
        self._canvas: Any = FigureCanvasAgg(figure)  # not fully typed
        self._background: Any = None
        self._limits: tuple[float, ...] = ()

    def render(self, moving: Sequence[Artist]) -> Pixels:
        """Return a frame of the film, (H, W, 3).

        Args:
            moving: Artists that may have changed, in any order.
        """
        for artist in moving:
            artist.set_animated(True)  # excludes the artist from the background
        canvas = self._canvas
        # The background is drawn again only if the limits of axes have changed.
        limits = tuple(
            value for axes in canvas.figure.axes for value in axes.viewLim.extents
        )
        if self._background is None or limits != self._limits:
            canvas.draw()
            self._background = canvas.copy_from_bbox(canvas.figure.bbox)
            self._limits = limits
        canvas.restore_region(self._background)
        for artist in sorted(moving, key=lambda each: each.get_zorder()):
            artist.draw(canvas.get_renderer())
        return np.asarray(canvas.buffer_rgba())[:, :, :3].copy()


class Film:
    """Writes a film of a run, frame by frame.

    Attributes:
        frames: Number of frames so far.
        error: The error that prevented writing; None if there was none.
        is_written: Whether the file is complete.
    """

    def __init__(
        self, path: Path, draw: Callable[[], Pixels], *, speed: float = SPEED
    ) -> None:
        """Prepare a film; nothing is written before the first frame.

        Args:
            path: The file; its ending determines the format.
            draw: Returns a frame of the current state, (H, W, 3), always the same size.
            speed: Simulated seconds per second of film.

        Raises:
            ValueError: If the format is unknown, or needs a package that is missing.
        """
        self.frames = 0
        self.error: OSError | None = None
        self.is_written = False
        self._path = path
        self._format = film_format(path)
        self._draw = draw
        self._interval = speed / FRAME_RATE
        self._start: float | None = None
        self._last: Pixels | None = None
        self._queue: Queue[Pixels | _GivenUp | None] = Queue(_AHEAD)
        self._encoder: threading.Thread | None = None

    def update(self, time: float) -> None:
        """Add all frames that are due. Call this method after each scan.

        Args:
            time: Time of the scan, s.
        """
        if self._start is None:
            self._start = time
        # A frame is due even if rounding makes the time slightly too early.
        due = int((time - self._start) / self._interval + 1e-9) + 1 - self.frames
        if due <= 0 or self.error is not None:
            return
        skipped = due - _LONGEST_GAP
        if skipped > 0:  # the clock has jumped
            self._start += skipped * self._interval
            due = _LONGEST_GAP
        self._add(self._draw(), times=due)

    def __enter__(self) -> "Film":
        return self

    def __exit__(self, *_: object) -> None:
        """Complete the film, also after an error; a second interrupt discards it."""
        if self._encoder is None:
            return
        # An interrupt may also come while the last frames are drawn or encoded.
        try:
            self._add(self._draw(), times=round(HOLD * FRAME_RATE))
            self._queue.put(None)
            self._encoder.join()
            self.is_written = self.error is None
        except BaseException:
            with suppress(Empty):
                while True:  # discard the frames that wait for the encoder
                    self._queue.get_nowait()
            self._queue.put(_GivenUp())
            self._encoder.join(_PATIENCE)
            raise

    def _add(self, pixels: Pixels, *, times: int) -> None:
        if self._encoder is None:
            size = pixels.shape[1], pixels.shape[0]
            self._encoder = threading.Thread(
                target=self._encode, args=(size,), name="film", daemon=True
            )
            self._encoder.start()
        for _ in range(times):
            # Frames need much memory, so the queue is
            # short: put() blocks while it is full.
            self._queue.put(pixels)
            self.frames += 1

    def _encode(self, size: tuple[int, int]) -> None:
        """Write the film; runs in the encoder's thread."""
        frames = self._frames()
        with suppress(_GivenUp):  # the temporary file is removed
            try:
                with (
                    written_atomically(self._path) as part,
                    open_encoder(part, self._format, size) as add,
                ):
                    for pixels in frames:
                        add(pixels)
            except OSError as error:
                self.error = error
            finally:
                for _ in frames:  # empty the queue, so that ``_add`` does not block
                    pass

    def _frames(self) -> Iterator[Pixels]:
        """Yield frames from the queue until the film is complete or is given up."""
        while (pixels := self._queue.get()) is not None:
            if isinstance(pixels, _GivenUp):
                raise pixels
            yield pixels


class _GivenUp(Exception):
    """Raised in the encoder's thread if the film is given up."""
