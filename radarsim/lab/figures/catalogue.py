"""The catalogue of figures, and how they are rendered, several at once."""

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from functools import partial
from typing import Final

from radarsim.autonomy.navigation.algorithms import Algorithm
from radarsim.lab.figures.dust import LASER, RADAR, draw_all_readings, draw_readings
from radarsim.lab.figures.figure import DrawnFigure
from radarsim.lab.figures.hedge import (
    draw_hokuyo,
    draw_radar,
    draw_repeated_scans,
    draw_single_scans,
)
from radarsim.lab.figures.rays import draw_offset_rays, draw_scatter
from radarsim.lab.figures.runs import draw_bug, draw_maps
from radarsim.lab.figures.scenes import draw_test_map, draw_trial_scene
from radarsim.processes import worker_pool


@dataclass(frozen=True, slots=True)
class FigureSpec:
    """A figure of the thesis and the function that draws it.

    Attributes:
        number: Number in the thesis, which has two figures 5; the second is 5b. A panel
            of several figures has the numbers of the first and the last: 2-5.
        title: Title, a few words.
        draw: Draws the figure from a seed.
        weight: Approximate drawing time, s.
    """

    number: str
    title: str
    draw: Callable[[int], DrawnFigure]
    weight: float = 0.5

    @property
    def file(self) -> str:
        """Name of the picture file."""
        first, dash, last = self.number.partition("-")
        if dash:
            return f"figures_{first:0>2}_to_{last:0>2}.png"
        digits = self.number.rstrip("b")
        return f"figure_{digits:0>2}{self.number[len(digits) :]}.png"


FIGURES: Final[tuple[FigureSpec, ...]] = (
    FigureSpec("1", "The trial scene", draw_trial_scene, 3),
    FigureSpec("2-5", "Dust blinds the laser and not the radar", draw_all_readings, 3),
    FigureSpec(
        "2", "Radar in clear air", partial(draw_readings, sensor=RADAR, air="clear"), 1
    ),
    FigureSpec(
        "3", "Radar in heavy dust", partial(draw_readings, sensor=RADAR, air="dust"), 1
    ),
    FigureSpec(
        "4", "Laser in clear air", partial(draw_readings, sensor=LASER, air="clear"), 1
    ),
    FigureSpec(
        "5", "Laser in heavy dust", partial(draw_readings, sensor=LASER, air="dust"), 1
    ),
    FigureSpec("5b", "One radar beam, several echoes", draw_scatter, 1),
    FigureSpec("6", "The test map: a wall of bushes", draw_test_map),
    FigureSpec("7", "The Hokuyo sees a wall", draw_hokuyo),
    FigureSpec("8", "The radar sees through the bushes", draw_radar),
    FigureSpec("9", "Noise of one scan: N = 0, 50, 100", draw_single_scans),
    FigureSpec("10", "Noise of repeated scans: N = 0, 50, 100", draw_repeated_scans),
    FigureSpec(
        "11", "Left and right rays, N = 50", partial(draw_offset_rays, offset=50)
    ),
    FigureSpec(
        "12", "Left and right rays, N = 100", partial(draw_offset_rays, offset=100)
    ),
    FigureSpec(
        "13",
        "Bug1 in a trap and at a closed box",
        partial(draw_bug, algorithm=Algorithm.BUG1),
        4,
    ),
    FigureSpec(
        "14",
        "Bug2 in a trap and at a closed box",
        partial(draw_bug, algorithm=Algorithm.BUG2),
        2,
    ),
    FigureSpec("15", "The test map as mapped by radar and by Hokuyo", draw_maps, 8),
)
NUMBERS: Final = tuple(entry.number for entry in FIGURES)


def select_figures(numbers: Sequence[str]) -> tuple[FigureSpec, ...]:
    """Return figures by their numbers, in the order of the catalogue.

    Raises:
        ValueError: If there is no figure of a number.
    """
    for number in numbers:
        if number not in NUMBERS:
            raise ValueError(f"figure {number[:80]!r}, expected some of {NUMBERS}")
    return tuple(entry for entry in FIGURES if entry.number in numbers)


@dataclass(frozen=True, slots=True)
class RenderedFigure:
    """A figure that is ready to be written to a file.

    Attributes:
        number: Number in the catalogue.
        title: Title, a few words.
        file: Name of the picture file.
        caption: What the figure shows, in two sentences.
        commands: Commands that take the same scans or drive the same path, and the one
            that draws the figure.
        png: Content of the picture file.
        details: The measured numbers, in sentences; a line for each paragraph.
        headline: What is written in the picture above all.
    """

    number: str
    title: str
    file: str
    caption: str
    commands: tuple[str, ...]
    png: bytes
    details: str = ""
    headline: str = ""


def render(number: str, seed: int) -> RenderedFigure:
    """Draw a figure; the same seed gives the same bytes."""
    (entry,) = select_figures([number])
    drawn = entry.draw(seed)
    return RenderedFigure(
        entry.number,
        entry.title,
        entry.file,
        drawn.caption,
        (*drawn.commands, f"radarsim figures OUT --only {number} --seed {seed}"),
        drawn.as_png(),
        drawn.details,
        drawn.headline,
    )


def render_all(
    wanted: Sequence[FigureSpec], seed: int, *, workers: int
) -> Generator[RenderedFigure, None, None]:
    """Draw figures on several cores, and yield each when it is ready.

    Args:
        wanted: Figures to draw.
        seed: Seed of all figures.
        workers: Number of processes; 1 draws in this process.
    """
    if workers == 1 or len(wanted) == 1:
        yield from (render(entry.number, seed) for entry in wanted)
        return
    # A long figure that began last would keep one worker busy after the others are
    # done.
    longest_first = sorted(wanted, key=lambda entry: -entry.weight)
    with worker_pool(workers) as pool:
        drawn = [pool.submit(render, entry.number, seed) for entry in longest_first]
        for each in as_completed(drawn):
            yield each.result()
