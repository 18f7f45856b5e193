"""The catalogue of figures, and how they are rendered, several at once."""

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from functools import partial
from typing import Final

from radarsim.evaluation.workers import worker_pool
from radarsim.figures.beam_scatter import draw_scatter
from radarsim.figures.bug_runs import draw_bug
from radarsim.figures.clear_and_dust import LASER, RADAR, draw_readings
from radarsim.figures.figure import DrawnFigure
from radarsim.figures.foliage_wall import draw_hokuyo, draw_noise, draw_radar
from radarsim.figures.maps import draw_maps
from radarsim.figures.offset_rays import draw_offset_rays
from radarsim.figures.scenes import draw_test_map, draw_trial_scene
from radarsim.navigation.options import Algorithm


@dataclass(frozen=True, slots=True)
class FigureSpec:
    """A figure of the thesis and the function that draws it.

    Attributes:
        number: Number in the thesis, which has two figures 5; the second is 5b.
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
        digits = self.number.rstrip("b")
        return f"figure_{digits:0>2}{self.number[len(digits) :]}.png"


FIGURES: Final = (
    FigureSpec("1", "The trial scene", draw_trial_scene, 3),
    FigureSpec(
        "2", "Radar, clear air", partial(draw_readings, sensor=RADAR, air="clear"), 1
    ),
    FigureSpec("3", "Radar, dust", partial(draw_readings, sensor=RADAR, air="dust"), 1),
    FigureSpec(
        "4", "Laser, clear air", partial(draw_readings, sensor=LASER, air="clear"), 1
    ),
    FigureSpec("5", "Laser, dust", partial(draw_readings, sensor=LASER, air="dust"), 1),
    FigureSpec("5b", "How a radar beam is scattered", draw_scatter, 1),
    FigureSpec("6", "The test map, seen from above", draw_test_map),
    FigureSpec("7", "The Hokuyo in the test map", draw_hokuyo),
    FigureSpec("8", "The radar in the test map", draw_radar),
    FigureSpec("9", "The radar with N = 50", partial(draw_noise, offset=50)),
    FigureSpec("10", "The radar with N = 100", partial(draw_noise, offset=100)),
    FigureSpec("11", "Offset rays, N = 50", partial(draw_offset_rays, offset=50)),
    FigureSpec("12", "Offset rays, N = 100", partial(draw_offset_rays, offset=100)),
    FigureSpec("13", "Bug1", partial(draw_bug, algorithm=Algorithm.BUG1), 4),
    FigureSpec("14", "Bug2", partial(draw_bug, algorithm=Algorithm.BUG2), 2),
    FigureSpec("15", "The explored test map, by radar and by Hokuyo", draw_maps, 8),
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
        caption: Caption, in sentences.
        commands: Commands that take the same scans or drive the same path, and the one
            that draws the figure.
        png: Content of the picture file.
    """

    number: str
    title: str
    file: str
    caption: str
    commands: tuple[str, ...]
    png: bytes


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
    longest_first = sorted(wanted, key=lambda entry: -entry.weight)
    with worker_pool(workers) as pool:
        drawn = [pool.submit(render, entry.number, seed) for entry in longest_first]
        for each in as_completed(drawn):
            yield each.result()
