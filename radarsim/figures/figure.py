"""Figures with their captions, as PNG files."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib import image
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from radarsim.plotting.annotations import QUIET

SOFTWARE: Final = "radarsim"  # metadata that marks a picture as radarsim's
_WHITE: Final = 255
_GAP: Final = 24  # pixels between drawings
TITLE_GAP: Final = 0.16  # inches above the title
TITLE_SIZE: Final = 17  # points
_SMALL_PRINT: Final = 0.52  # inches from the top


@dataclass(frozen=True, slots=True)
class DrawnFigure:
    """A figure that has been drawn, with its caption.

    Attributes:
        drawings: Drawings, one below the other.
        caption: What the figure shows and what to see in it, in two sentences.
        commands: Commands that take the same scans, drive the same path or show more.
        details: The measured numbers, in sentences; a line for each paragraph.
    """

    drawings: tuple[Figure, ...]
    caption: str
    commands: tuple[str, ...] = ()
    details: str = ""

    @property
    def headline(self) -> str:
        """What is written above the drawings, or above their panels."""
        texts = [
            text.get_text() for drawing in self.drawings for text in drawing.texts[:1]
        ]
        panels = [axes for drawing in self.drawings for axes in drawing.axes]
        titles = [axes.get_title(loc="left") for axes in panels]
        return "; ".join(texts or filter(None, titles))

    def as_png(self) -> bytes:
        """Return the content of a PNG file; equal drawings give equal bytes."""
        pixels = _stack([_rasterise(drawing) for drawing in self.drawings])
        data = io.BytesIO()
        image.imsave(data, pixels, format="png", metadata={"Software": SOFTWARE})
        return data.getvalue()


def png_size(png: bytes) -> tuple[int, int]:
    """Return the width and height of a PNG file, pixels."""
    return int.from_bytes(png[16:20], "big"), int.from_bytes(png[20:24], "big")


def is_radarsim_figure(png: bytes) -> bool:
    """Return whether a PNG file, or its first kilobyte, was written by this program."""
    return f"Software\0{SOFTWARE}".encode() in png[:1024]


def _rasterise(drawing: Figure) -> NDArray[np.uint8]:
    data = io.BytesIO()
    FigureCanvasAgg(drawing).print_figure(data, format="rgba")
    width, height = drawing.canvas.get_width_height()
    flat = np.frombuffer(data.getvalue(), np.uint8)
    return flat.reshape(height, width, 4)[:, :, :3]


def _stack(pictures: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Stack pictures vertically, padded with white on the right."""
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


def draw_title(drawing: Figure, text: str) -> None:
    """Write the title of a figure at its upper left."""
    _, height = drawing.get_size_inches()
    place = (0.02, 1 - TITLE_GAP / height)
    drawing.text(*place, text, va="top", fontsize=TITLE_SIZE, fontweight="bold")


def draw_small_print(drawing: Figure, text: str) -> None:
    """Write a text below the title of a figure."""
    _, height = drawing.get_size_inches()
    drawing.text(0.02, 1 - _SMALL_PRINT / height, text, va="top", color=QUIET)
