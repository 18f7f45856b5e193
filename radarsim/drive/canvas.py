"""Dots on a grid of characters: braille has eight of them in each, two by four."""

from itertools import groupby
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats

Fragments: TypeAlias = list[tuple[str, str]]  # of one line: style and text

DOTS_ACROSS: Final = 2
DOTS_DOWN: Final = 4
BRAILLE: Final = 0x2800  # the character without dots
BITS: Final = np.array([[1, 8], [2, 16], [4, 32], [64, 128]])


class Canvas:
    """A drawing in inks, which are styles in the order of their importance."""

    def __init__(self, columns: int, rows: int, inks: tuple[str, ...]) -> None:
        """Begin with an empty one.

        Args:
            columns: Characters in a line, at least 1.
            rows: Lines, at least 1.
            inks: Styles; in a cell of several the last of them counts.
        """
        self.columns = columns
        self.rows = rows
        self._styles = ("", *inks)
        self._dots = np.zeros((rows * DOTS_DOWN, columns * DOTS_ACROSS), dtype=np.int8)
        self._letters: dict[tuple[int, int], tuple[str, str]] = {}

    @property
    def height(self) -> int:
        """In dots."""
        return self._dots.shape[0]

    @property
    def width(self) -> int:
        """In dots."""
        return self._dots.shape[1]

    def plot(self, across: Floats, down: Floats, ink: str) -> None:
        """Set dots.

        Args:
            across: (N,) in dots from the left edge; what is off the canvas is left out.
            down: (N,) in dots from the upper edge.
            ink: One of those of the canvas.
        """
        # Compared before they are made integers: a distance may be too large for one.
        inside = (across >= 0) & (across < self.width)
        inside &= (down >= 0) & (down < self.height)
        at = down[inside].astype(np.intp), across[inside].astype(np.intp)
        self._dots[at] = np.maximum(self._dots[at], self._styles.index(ink))

    def write(self, row: int, column: int, text: str, style: str) -> None:
        """Write over the dots, as far as there is place."""
        for i, letter in enumerate(text, start=column):
            self._letters[row, i] = style, letter

    def lines(self) -> list[Fragments]:
        """Give the lines from the top, each as wide as the canvas."""
        shape = self.rows, DOTS_DOWN, self.columns, DOTS_ACROSS
        cells = self._dots.reshape(shape).transpose(0, 2, 1, 3)
        bits = ((cells > 0) * BITS).sum(axis=(2, 3))
        inks: NDArray[np.int8] = cells.max(axis=(2, 3))
        lines = []
        for row in range(self.rows):
            line = [
                self._letters.get((row, column)) or self._braille(*cell)
                for column, cell in enumerate(zip(bits[row], inks[row], strict=True))
            ]
            lines.append(_joined(line))
        return lines

    def _braille(self, bits: int, ink: int) -> tuple[str, str]:
        # A blank rather than braille without dots, so that a copied picture is plain.
        return self._styles[ink], chr(BRAILLE + bits) if bits else " "


def _joined(cells: Fragments) -> Fragments:
    """Join neighbours of one style."""
    return [
        (style, "".join(text for _, text in cells))
        for style, cells in groupby(cells, key=lambda cell: cell[0])
    ]
