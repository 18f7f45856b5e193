"""``radarsim bench``."""

import json

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from radarsim.benchmark.measurement import GROUPS, Row
from radarsim.benchmark.run import run_all


def run_benchmarks(*, as_json: bool) -> None:
    """Measure, with a bar on stderr, and print a table or JSON on stdout."""
    columns = (TextColumn("{task.description:10}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("bench")

        def tell(name: str, done: int, whole: int) -> None:
            progress.update(task, description=name, completed=done, total=whole)

        rows = run_all(tell)
    if as_json:
        typer.echo(json.dumps([row.to_dict() for row in rows], indent=2))
        return
    console = Console()
    for letter, title in GROUPS.items():
        group = [row for row in rows if row.group == letter]
        if group:
            console.print(_table(f"({letter}) {title}", group))


def _table(title: str, rows: list[Row]) -> Table:
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
