"""A figure that is drawn, and what is said about it."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib import image
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

MARK: Final = "radarsim"  # what a picture says that it is from
_WHITE: Final = 255
_GAP: Final = 24  # pixels between drawings


@dataclass(frozen=True, slots=True)
class Plate:
    """What a figure shows.

    Attributes:
        drawings: One below the other.
        caption: What to see, in sentences, with what was measured.
        commands: What takes the same scans, drives the same way or shows more of it.
    """

    drawings: tuple[Figure, ...]
    caption: str
    commands: tuple[str, ...] = ()

    def as_png(self) -> bytes:
        """Give a PNG file; the same for the same drawings."""
        pixels = _stacked([_painted(drawing) for drawing in self.drawings])
        data = io.BytesIO()
        image.imsave(data, pixels, format="png", metadata={"Software": MARK})
        return data.getvalue()


def size_of(png: bytes) -> tuple[int, int]:
    """Give the width and height of a PNG file, pixels."""
    return int.from_bytes(png[16:20], "big"), int.from_bytes(png[20:24], "big")


def is_ours(png: bytes) -> bool:
    """Tell whether a file, or its first kilobyte, is a figure of this program."""
    return f"Software\0{MARK}".encode() in png[:1024]


def _painted(drawing: Figure) -> NDArray[np.uint8]:
    data = io.BytesIO()
    FigureCanvasAgg(drawing).print_figure(data, format="rgba")
    width, height = drawing.canvas.get_width_height()
    flat = np.frombuffer(data.getvalue(), np.uint8)
    return flat.reshape(height, width, 4)[:, :, :3]


def _stacked(pictures: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Put pictures below each other, the narrower ones on the left of white."""
    width = max(picture.shape[1] for picture in pictures)
    rows = [
        np.pad(
            picture,
            (
                (_GAP if number else 0, 0),
                (0, width - picture.shape[1]),
                (0, 0),
            ),
            constant_values=_WHITE,
        )
        for number, picture in enumerate(pictures)
    ]
    return np.concatenate(rows)
