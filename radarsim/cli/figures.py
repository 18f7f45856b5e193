"""``radarsim figures``."""

import os
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from radarsim.cli.options import write_file
from radarsim.figures.catalogue import FIGURES, Entry, Made, entries_of, make_all
from radarsim.figures.figure import is_ours
from radarsim.figures.page import (
    FILE,
    GENERATOR,
    block_of,
    blocks_in,
    page_of,
)

_HEAD = 1024  # bytes, within which a file of ours says so
_FEW = 2.0  # s of work that no other process is started for


def make_figures(out: Path, *, seed: int, only: str | None) -> None:
    """Draw figures, with a bar on stderr, and print where the page is.

    Args:
        out: The folder, made if it is not there.
        seed: Of all figures.
        only: Numbers with commas between them; None for all figures.

    Raises:
        typer.BadParameter: If an option is wrong, or the folder cannot be used.
    """
    wanted = _read(only)
    _prepare(out, wanted)
    weight = sum(entry.weight for entry in wanted)
    workers = 1 if weight <= _FEW else min(len(wanted), os.cpu_count() or 1)
    columns = (TextColumn("{task.description:14}"), BarColumn(), TimeElapsedColumn())
    bar = Progress(*columns, console=Console(stderr=True), transient=True)
    made: list[Made] = []
    with bar, closing(make_all(wanted, seed, workers=workers)) as figures:
        task = bar.add_task("figures", total=weight)
        for figure in figures:
            write_file(out / figure.file, figure.png, "OUT")
            made.append(figure)
            (entry,) = entries_of([figure.number])
            told = f"figure {entry.number} done"
            bar.update(task, advance=entry.weight, description=told)
    write_file(out / FILE, _page(out, made).encode(), "OUT")
    typer.echo(out / FILE)


def _read(only: str | None) -> tuple[Entry, ...]:
    if only is None:
        return FIGURES
    numbers = [text.strip().lower().lstrip("0") for text in only.split(",")]
    try:
        return entries_of(numbers)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--only") from None


def _prepare(out: Path, wanted: Sequence[Entry]) -> None:
    """Make the folder, and find out whether anything in it is somebody else's."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        for name in (FILE, *(entry.file for entry in wanted)):
            _check(out / name)
    except OSError as error:
        text = f"cannot write to {out}: {(error.strerror or '').lower()}"
        raise typer.BadParameter(text, param_hint="OUT") from None


def _check(path: Path) -> None:
    if not path.exists():
        return
    with path.open("rb") as file:
        head = file.read(_HEAD)
    ours = GENERATOR.encode() in head if path.name == FILE else is_ours(head)
    if not ours:
        text = f"{path} is not by radarsim, expected a folder without such a file"
        raise typer.BadParameter(text, param_hint="OUT")


def _page(out: Path, made: Sequence[Made]) -> str:
    """Put the new figures on the page, beside those that are there from before."""
    page = out / FILE
    before = (
        blocks_in(page.read_text(encoding="utf-8", errors="replace"))
        if page.exists()
        else {}
    )
    blocks = before | {figure.number: block_of(figure) for figure in made}
    return page_of(
        blocks[entry.number]
        for entry in FIGURES
        if entry.number in blocks and (out / entry.file).exists()
    )
