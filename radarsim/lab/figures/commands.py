"""``radarsim figures``: the thesis' figures, and a page that shows them."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import click
from rich.console import Console

from radarsim.cli.compile_progress import compile_now, with_compile_progress
from radarsim.cli.fields import Seed
from radarsim.cli.files import write_file
from radarsim.cli.output import print_lines
from radarsim.errors import describe_os_error
from radarsim.files import is_by_radarsim
from radarsim.plans import Option
from radarsim.processes import process_cpu_count, raise_on_signals

if TYPE_CHECKING:
    from radarsim.lab.figures.catalogue import FigureSpec, RenderedFigure

_SMALL_WEIGHT: Final = 2.0  # s of work that is not worth starting processes


@with_compile_progress
def figures(
    out: Annotated[Path, Option(is_argument=True)],
    *,
    only: Annotated[str | None, Option(metavar="N,...")] = None,
    seed: Seed = 0,
) -> None:
    """Draw the figures of the thesis.

    They are drawn from runs of the program, and OUT gets a page that shows them.

    Args:
        out: A folder; it is created if necessary.
        only: Numbers of figures; all by default.
        seed: Seed of all random numbers.
    """
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from radarsim.autonomy.exploration.compilation import warm_up
    from radarsim.lab.figures.catalogue import render_all, select_figures
    from radarsim.lab.figures.page import FILE

    wanted = _read_numbers(only)
    _prepare(out, [FILE, *(entry.file for entry in wanted)])
    maps_are_drawn = any(entry.number == "15" for entry in wanted)
    compile_now(*([warm_up] if maps_are_drawn else []))
    weight = sum(entry.weight for entry in wanted)
    workers = 1 if weight <= _SMALL_WEIGHT else min(len(wanted), process_cpu_count())
    columns = (TextColumn("{task.description:14}"), BarColumn(), TimeElapsedColumn())
    bar = Progress(*columns, console=Console(stderr=True), transient=True)
    made: list[RenderedFigure] = []
    with (
        raise_on_signals(),
        bar,
        closing(render_all(wanted, seed, workers=workers)) as drawn,
    ):
        task = bar.add_task("figures", total=weight)
        for figure in drawn:
            write_file(out / figure.file, figure.png, "OUT")
            made.append(figure)
            (entry,) = select_figures([figure.number])
            status = f"figure {entry.number} done"
            bar.update(task, advance=entry.weight, description=status)
    write_file(out / FILE, _page(out, made).encode(), "OUT")
    print_lines([out / FILE])


def _read_numbers(only: str | None) -> tuple[FigureSpec, ...]:
    from radarsim.lab.figures.catalogue import FIGURES, select_figures

    if only is None:
        return FIGURES
    numbers = [text.strip().lower().lstrip("0") for text in only.split(",")]
    try:
        return select_figures(numbers)
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint="--only") from None


def _prepare(out: Path, names: Sequence[str]) -> None:
    """Create the folder, and refuse to overwrite files of other programs."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        for name in names:
            _check_overwriting(out / name)
    except OSError as error:
        text = f"cannot write to {out}: {describe_os_error(error)}"
        raise click.BadParameter(text, param_hint="OUT") from None


def _check_overwriting(path: Path) -> None:
    if path.exists() and not is_by_radarsim(path):
        text = f"{path} is not by radarsim, expected a folder without such a file"
        raise click.BadParameter(text, param_hint="OUT")


def _page(out: Path, made: Sequence[RenderedFigure]) -> str:
    """Return the page with the new figures and those that it showed before."""
    from radarsim.lab.figures.catalogue import FIGURES
    from radarsim.lab.figures.page import FILE, figure_block, render_page, split_page

    page = out / FILE
    blocks = {}
    if page.exists():
        blocks = split_page(page.read_text(encoding="utf-8", errors="replace"))
    blocks |= {figure.number: figure_block(figure) for figure in made}
    return render_page(
        blocks[entry.number]
        for entry in FIGURES
        if entry.number in blocks and (out / entry.file).exists()
    )
