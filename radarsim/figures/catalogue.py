"""The table of figures: what there is, by number."""

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from functools import partial
from typing import Final

from radarsim.evaluation.workers import worker_pool
from radarsim.figures.beam_scatter import draw_scatter
from radarsim.figures.bug_runs import draw_bug
from radarsim.figures.clear_and_dust import LASER, RADAR, draw_readings
from radarsim.figures.figure import Plate
from radarsim.figures.foliage_wall import draw_hokuyo, draw_noise, draw_radar
from radarsim.figures.maps import draw_maps
from radarsim.figures.offset_rays import draw_offset_rays
from radarsim.figures.scenes import draw_test_map, draw_trial_scene
from radarsim.navigation.options import Algorithm


@dataclass(frozen=True, slots=True)
class Entry:
    """A figure that can be drawn.

    Attributes:
        number: That the thesis gives it; of its two figures 5 the second one is 5b.
        title: What it shows, in a few words.
        draw: Draws it from a seed.
        weight: About how long that takes, s.
    """

    number: str
    title: str
    draw: Callable[[int], Plate]
    weight: float = 0.5

    @property
    def file(self) -> str:
        """The name of its picture."""
        digits = self.number.rstrip("b")
        return f"figure_{digits:0>2}{self.number[len(digits) :]}.png"


FIGURES: Final = (
    Entry("1", "The trial scene", draw_trial_scene, 3),
    Entry(
        "2", "Radar, clear air", partial(draw_readings, sensor=RADAR, air="clear"), 1
    ),
    Entry("3", "Radar, dust", partial(draw_readings, sensor=RADAR, air="dust"), 1),
    Entry(
        "4", "Laser, clear air", partial(draw_readings, sensor=LASER, air="clear"), 1
    ),
    Entry("5", "Laser, dust", partial(draw_readings, sensor=LASER, air="dust"), 1),
    Entry("5b", "How a radar beam is scattered", draw_scatter, 1),
    Entry("6", "The test map, seen from above", draw_test_map),
    Entry("7", "The Hokuyo in the test map", draw_hokuyo),
    Entry("8", "The radar in the test map", draw_radar),
    Entry("9", "The radar with N = 50", partial(draw_noise, offset=50)),
    Entry("10", "The radar with N = 100", partial(draw_noise, offset=100)),
    Entry("11", "Offset rays, N = 50", partial(draw_offset_rays, offset=50)),
    Entry("12", "Offset rays, N = 100", partial(draw_offset_rays, offset=100)),
    Entry("13", "Bug1", partial(draw_bug, algorithm=Algorithm.BUG1), 4),
    Entry("14", "Bug2", partial(draw_bug, algorithm=Algorithm.BUG2), 2),
    Entry("15", "The explored test map, by radar and by Hokuyo", draw_maps, 8),
)
NUMBERS: Final = tuple(entry.number for entry in FIGURES)


def entries_of(numbers: Sequence[str]) -> tuple[Entry, ...]:
    """Find figures by their numbers; they come in the order of the table.

    Raises:
        ValueError: If there is no such figure.
    """
    for number in numbers:
        if number not in NUMBERS:
            raise ValueError(f"figure {number[:80]!r}, expected some of {NUMBERS}")
    return tuple(entry for entry in FIGURES if entry.number in numbers)


# Section from study.figures.making.
# Figures made, several at once.


@dataclass(frozen=True, slots=True)
class Made:
    """A figure that is ready to be written.

    Attributes:
        number: In the table.
        title: What it shows, in a few words.
        file: The name of its picture.
        caption: What to see.
        commands: What takes the same scans or drives the same way, and what draws it.
        png: The picture.
    """

    number: str
    title: str
    file: str
    caption: str
    commands: tuple[str, ...]
    png: bytes


def make(number: str, seed: int) -> Made:
    """Draw a figure; the same seed gives the same bytes."""
    (entry,) = entries_of([number])
    plate = entry.draw(seed)
    return Made(
        entry.number,
        entry.title,
        entry.file,
        plate.caption,
        (*plate.commands, f"radarsim figures OUT --only {number} --seed {seed}"),
        plate.as_png(),
    )


def make_all(
    wanted: Sequence[Entry], seed: int, *, workers: int
) -> Generator[Made, None, None]:
    """Draw figures on several cores; they come as they are ready.

    Args:
        wanted: What to draw.
        seed: Of all of them.
        workers: Processes; with one, all are drawn in this one.
    """
    if workers == 1 or len(wanted) == 1:
        yield from (make(entry.number, seed) for entry in wanted)
        return
    longest_first = sorted(wanted, key=lambda entry: -entry.weight)
    with worker_pool(workers) as pool:
        drawn = [pool.submit(make, entry.number, seed) for entry in longest_first]
        for each in as_completed(drawn):
            yield each.result()
