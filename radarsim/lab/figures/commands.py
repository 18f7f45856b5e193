"""``radarsim figures``: the thesis' figures, and a page that shows them."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Annotated, Final

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

    from radarsim.lab.figures.catalogue import FIGURES, render_all, select_figures
    from radarsim.lab.figures.page import FILE, figure_block, render_page, split_page

    wanted = FIGURES
    if only is not None:
        numbers = [text.strip().lower().lstrip("0") for text in only.split(",")]
        try:
            wanted = select_figures(numbers)
        except ValueError as error:
            raise click.BadParameter(str(error), param_hint="--only") from None
    page = out / FILE
    try:
        out.mkdir(parents=True, exist_ok=True)
        for path in (page, *(out / entry.file for entry in wanted)):
            if path.exists() and not is_by_radarsim(path):
                text = f"{path} is not by radarsim, expected a folder without such a"
                raise click.BadParameter(f"{text} file", param_hint="OUT")
    except OSError as error:
        text = f"cannot write to {out}: {describe_os_error(error)}"
        raise click.BadParameter(text, param_hint="OUT") from None
    maps_are_drawn = any(entry.number == "15" for entry in wanted)
    compile_now(*(["mapping"] if maps_are_drawn else []))
    weight = sum(entry.weight for entry in wanted)
    workers = 1 if weight <= _SMALL_WEIGHT else min(len(wanted), process_cpu_count())
    columns = (TextColumn("{task.description:14}"), BarColumn(), TimeElapsedColumn())
    bar = Progress(*columns, console=Console(stderr=True), transient=True)
    weights = {entry.number: entry.weight for entry in wanted}
    blocks = {}
    if page.exists():  # and it keeps what it showed before
        blocks = split_page(page.read_text(encoding="utf-8", errors="replace"))
    with (
        raise_on_signals(),
        bar,
        closing(render_all(wanted, seed, workers=workers)) as drawn,
    ):
        task = bar.add_task("figures", total=weight)
        for figure in drawn:
            write_file(out / figure.file, figure.png, "OUT")
            blocks[figure.number] = figure_block(figure)
            status = f"figure {figure.number} done"
            bar.update(task, advance=weights[figure.number], description=status)
    shown = [
        blocks[entry.number]
        for entry in FIGURES
        if entry.number in blocks and (out / entry.file).exists()
    ]
    write_file(page, render_page(shown).encode(), "OUT")
    print_lines([page])
