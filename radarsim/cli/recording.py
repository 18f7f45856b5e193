"""``radarsim recording``: what recordings contain, and their repair."""

from __future__ import annotations

from collections import Counter

import typer
from rich.console import Console
from rich.table import Column, Table

from radarsim.cli.replay import FolderArgument, end_text

recording = typer.Typer(no_args_is_help=True, help="Look into recordings.")


@recording.command()
def info(folder: FolderArgument) -> None:
    """Print what a recording contains."""
    from radarsim.recording.bag_folder import check_installed

    check_installed()
    from radarsim.recording.bag_reader import BagReader

    bag = BagReader(folder)
    counts: Counter[tuple[str, str]] = Counter()
    last = 0
    for message in bag.messages():
        counts[message.topic, message.message.type] += 1
        last = max(last, message.time)
    conditions = bag.info
    typer.echo(f"{folder}: {last / 1e9:.2f} s, radarsim {conditions.version}")
    typer.echo(
        f"map {conditions.map or conditions.level}, seed {conditions.seed},"
        f" dialect {conditions.dialect}"
    )
    table = Table(Column("topic", overflow="fold"), "type", "messages")
    for (topic, type_), count in sorted(counts.items()):
        table.add_row(topic, type_, str(count))
    Console().print(table)
    if not bag.is_complete:
        typer.echo(end_text(bag))


@recording.command()
def repair(folder: FolderArgument) -> None:
    """Complete a recording that breaks off, with all that can be read of it."""
    from radarsim.recording.bag_folder import check_installed

    check_installed()
    from radarsim.recording.bag_reader import repair as repair_bag

    typer.echo(f"{folder}: complete, {repair_bag(folder)} messages")
