"""Dots on a grid of characters: braille has eight of them in each, two by four."""

from itertools import groupby
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.client.robot_info import RobotInfo
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


# Section from drive.view.
# A scan seen from above, with the robot in the middle and its front upwards.

RADII: Final = (1, 2, 5, 10, 20, 50, 100)  # m, from the robot to the nearer edges
BARS: Final = (0.5, 1, 2, 5, 10, 20, 50, 100)  # m
LONGEST_BAR: Final = 1 / 3  # of the width
LEAST_HULL: Final = 8  # dots; a hull that would be drawn shorter is an arrow only
NEAR: Final = 0.3  # m, around a robot that turns
MIDDLE: Final = 1.0  # m

INKS: Final = ("class:far", "class:middle", "class:near", "class:robot")
FAR_INK, MIDDLE_INK, NEAR_INK, ROBOT_INK = INKS
SCALE_STYLE: Final = "class:scale"


def ink_of(distance: float, clearance: float) -> str:
    """Give the style of what is so many metres from the robot's centre.

    Args:
        distance: m.
        clearance: What the robot needs around its centre to turn, m.
    """
    free = distance - clearance
    if free < NEAR:
        return NEAR_INK
    return MIDDLE_INK if free < MIDDLE else FAR_INK


def draw_view(
    points: Floats, facts: RobotInfo, radius: float, columns: int, rows: int
) -> list[Fragments]:
    """Draw obstacles, robot and scale.

    Args:
        points: (N, 2) m from the robot's centre, x ahead and y to its left.
        facts: Of the robot.
        radius: Shown around the robot, m.
        columns: Characters in a line, at least 1.
        rows: Lines, at least 1.

    Returns:
        The lines from the top, each as wide as asked for.
    """
    canvas = Canvas(columns, rows, INKS)
    dots_per_metre = min(canvas.width, canvas.height) / 2 / radius

    def plot(places: Floats, ink: str) -> None:
        across = canvas.width / 2 - places[:, 1] * dots_per_metre
        down = canvas.height / 2 - places[:, 0] * dots_per_metre
        canvas.plot(across, down, ink)

    free = np.hypot(points[:, 0], points[:, 1]) - facts.clearance
    near, middle = free < NEAR, free < MIDDLE
    plot(points[~middle], FAR_INK)
    plot(points[middle & ~near], MIDDLE_INK)
    plot(points[near], NEAR_INK)
    if facts.length * dots_per_metre >= LEAST_HULL:
        plot(_hull(facts, dots_per_metre), ROBOT_INK)
    canvas.write(rows // 2, columns // 2, "▲", ROBOT_INK)
    canvas.write(rows - 1, 0, scale_bar(dots_per_metre, columns), SCALE_STYLE)
    return canvas.lines()


def scale_bar(dots_per_metre: float, columns: int) -> str:
    """Give a bar of a round length, and that length; the longest that fits.

    Args:
        dots_per_metre: So few that half the width shows 1 m or more.
        columns: Of the view.
    """
    most = columns * LONGEST_BAR * DOTS_ACROSS / dots_per_metre
    length = max(bar for bar in BARS if bar <= most)
    cells = max(round(length * dots_per_metre / DOTS_ACROSS), 2)
    return f"├{'─' * (cells - 2)}┤ {length:g} m "


def _hull(facts: RobotInfo, dots_per_metre: float) -> Floats:
    """Give places on the outline, a dot apart, (N, 2) m."""
    along = np.arange(-0.5, 0.5, 1 / (max(facts.length, facts.width) * dots_per_metre))
    half = np.full_like(along, 0.5)
    sides = [(along, half), (along, -half), (half, along), (-half, along)]
    outline = np.concatenate([np.column_stack(side) for side in sides])
    scaled: Floats = outline * (facts.length, facts.width)
    return scaled
