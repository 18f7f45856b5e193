"""Figures made, several at once."""

from collections.abc import Generator, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass

from radarsim.study.figures.table import Entry, entries_of
from radarsim.study.workers import worker_pool


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
