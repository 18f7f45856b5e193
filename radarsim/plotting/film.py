"""Films of runs: frames at a fixed rate of simulated time, encoded as they come.

A run calls ``Film.update`` after each scan; the film draws a frame whenever one is due,
and a thread of its own encodes it meanwhile. A run that is interrupted leaves a film of
what happened until then.
"""

import contextlib
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from queue import Full, Queue
from types import TracebackType
from typing import Any, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from radarsim.atomic_write import written_atomically
from radarsim.plotting.film_encoders import (
    FRAME_RATE,
    Pixels,
    film_format,
    open_encoder,
)

SPEED: Final = 6.0  # simulated seconds per second of film
HOLD: Final = 2.0  # s for which the last frame is shown
_AHEAD: Final = 4  # frames that wait for the encoder at most
_LONGEST_GAP: Final = 20  # frames for which a film waits for a scan
_PATIENCE: Final = 10.0  # s for the encoder to stop once the film is given up


class FrameCanvas:
    """Renders the frames of a film; what does not move is drawn once."""

    def __init__(self, figure: Figure) -> None:
        self._canvas: Any = FigureCanvasAgg(figure)  # parts of it have no types
        self._background: Any = None
        self._limits: tuple[float, ...] = ()

    def render(self, moving: Sequence[Artist]) -> Pixels:
        """Return a frame, (H, W, 3).

        Args:
            moving: What may have changed, in any order.
        """
        for artist in moving:
            artist.set_animated(True)  # the background is drawn without it
        canvas = self._canvas
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
    """Films a run.

    Attributes:
        frames: Number of frames so far.
        error: Why the film could not be written; None if nothing went wrong.
        is_written: Whether the file is complete.
    """

    def __init__(
        self, path: Path, draw: Callable[[], Pixels], *, speed: float = SPEED
    ) -> None:
        """Prepare a film; nothing is written before the first frame.

        Args:
            path: The file; its ending chooses the format.
            draw: Returns a frame of the run as it is, (H, W, 3), always as large.
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
        self._queue: Queue[Pixels | None] = Queue(_AHEAD)
        self._given_up = threading.Event()
        self._encoder: threading.Thread | None = None

    @property
    def duration(self) -> float:
        """Length of the film so far, s."""
        return self.frames / FRAME_RATE

    def update(self, time: float) -> None:
        """Add the frames that are due; to be called after each scan.

        Args:
            time: Time of the scan, s.
        """
        if self._start is None:
            self._start = time
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

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Complete the film, however the run ended; a second interrupt drops it."""
        if self._encoder is None:
            return
        try:
            self._add(self._draw(), times=round(HOLD * FRAME_RATE))
            self._queue.put(None)
            self._encoder.join()
            self.is_written = self.error is None
        except BaseException:
            self._given_up.set()
            with contextlib.suppress(Full):
                self._queue.put_nowait(None)
            self._encoder.join(_PATIENCE)
            raise

    def _add(self, pixels: Pixels, *, times: int) -> None:
        if self._encoder is None:
            arguments = (pixels.shape[1], pixels.shape[0])
            self._encoder = threading.Thread(
                target=self._encode, args=(arguments,), name="film", daemon=True
            )
            self._encoder.start()
        for _ in range(times):
            self._queue.put(pixels)
            self.frames += 1

    def _encode(self, size: tuple[int, int]) -> None:
        """Write the film, in a thread of its own."""
        is_read = False
        try:
            with (
                written_atomically(self._path) as part,
                open_encoder(part, self._format, size) as encoder,
            ):
                while (pixels := self._next()) is not None:
                    encoder.add(pixels)
                is_read = True
        except OSError as error:
            self.error = error
        except _GivenUp:
            is_read = True
        finally:
            while not is_read:  # so that whoever films does not wait
                is_read = self._given_up.is_set() or self._queue.get() is None

    def _next(self) -> Pixels | None:
        pixels = self._queue.get()
        if self._given_up.is_set():
            raise _GivenUp
        return pixels


class _GivenUp(Exception):
    """Nobody waits for the film any more."""
