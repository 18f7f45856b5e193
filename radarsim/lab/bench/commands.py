"""``radarsim bench``: measured times of the engine and the server."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.table import Table

from radarsim.cli.compile_progress import compile_now, with_compile_progress
from radarsim.cli.fields import Json
from radarsim.processes import raise_on_signals

if TYPE_CHECKING:
    from radarsim.lab.bench.timing import BenchmarkRow


@with_compile_progress
def bench(*, as_json: Json = False) -> None:
    """Measure the engine and the server on this machine.

    It takes a few minutes.

    Args:
        as_json: Print JSON, for programs.
    """
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from radarsim.lab.bench.run import run_all
    from radarsim.lab.bench.timing import GROUPS

    compile_now()
    columns = (TextColumn("{task.description:10}"), BarColumn(), TimeElapsedColumn())
    bar = Progress(*columns, console=Console(stderr=True), transient=True)
    with raise_on_signals(), bar as progress:
        task = progress.add_task("bench")

        def update(name: str, done: int, total: int) -> None:
            progress.update(task, description=name, completed=done, total=total)

        rows = run_all(update)
    if as_json:
        click.echo(json.dumps([row.to_dict() for row in rows], indent=2))
        return
    console = Console()
    for letter, title in GROUPS.items():
        group = [row for row in rows if row.group == letter]
        if group:
            console.print(_table(f"({letter}) {title}", group))


def _table(title: str, rows: list[BenchmarkRow]) -> Table:
    table = Table(title=title, title_justify="left")
    table.add_column("what", overflow="fold")
    table.add_column("figure", justify="right")
    table.add_column("at most", justify="right")
    table.add_column("", overflow="fold")
    for row in rows:
        limit = "" if row.limit is None else f"{row.limit:g}"
        mark = {None: "", True: "kept", False: "MISSED"}[row.within]
        note = "; ".join(text for text in (mark, row.note) if text)
        table.add_row(row.name, f"{row.value:.4g} {row.unit}", limit, note)
    return table
