"""``radarsim replay``: play a recording to clients, or repeat its run.

``radarsim recording``: what recordings contain, and their repair.
"""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Column, Table

from radarsim import __version__
from radarsim.cli.options import DEFAULT_PORT, check_positive
from radarsim.cli.output import print_message, start_log
from radarsim.cli.serve import announce
from radarsim.cli.server_options import ListenHostOption, ListenPortOption
from radarsim.errors import RecordingError

if TYPE_CHECKING:
    from radarsim.addons.recording.bag_reader import BagReader
    from radarsim.server.host import Host

FolderArgument = Annotated[
    Path, typer.Argument(metavar="DIR", help="Folder of the recording.")
]
VerifyOption = Annotated[
    bool,
    typer.Option(
        "--verify",
        help="Instead, simulate the run again from the recorded commands, and"
        " compare all that clients were sent; exit with 1 if a byte differs.",
    ),
]
VerifiedMapOption = Annotated[
    str | None,
    typer.Option("--map", help="The map to verify with; the recorded one if none."),
]
ClientOption = Annotated[
    int | None,
    typer.Option(
        min=1, help="Number of the recorded client to play; the busiest if none."
    ),
]
PlayingSpeedOption = Annotated[
    float,
    typer.Option(
        callback=check_positive, help="Recorded seconds per second of real time."
    ),
]


def replay(
    folder: FolderArgument,
    *,
    verify: VerifyOption = False,
    map_: VerifiedMapOption = None,
    client: ClientOption = None,
    host: ListenHostOption = "127.0.0.1",
    port: ListenPortOption = DEFAULT_PORT,
    speed: PlayingSpeedOption = 1.0,
) -> None:
    """Play a recording to clients of the protocol, as they were sent it."""
    from radarsim.addons.recording.bag_folder import check_installed

    check_installed()
    from radarsim.addons.recording.bag_reader import BagReader
    from radarsim.addons.recording.replay import (
        ReplayServer,
        choose_client,
        recorded_clients,
    )

    bag = BagReader(folder)
    if verify:
        _verify(bag, map_)
        return
    start_log(logging.WARNING, "%(asctime)s %(levelname)s %(message)s")
    recorded = choose_client(recorded_clients(bag.calls()), client)
    _warn_of_end(bag)
    server = ReplayServer(recorded, speed=speed)
    raise typer.Exit(asyncio.run(server.serve(host, port, announce)))


def _verify(bag: BagReader, map_: str | None) -> None:
    """Simulate a run again, and tell whether it is the same.

    Raises:
        RecordingError: If the map has changed.
        typer.Exit: If something differs.
    """
    from radarsim.addons.recording.replay import repeat_run

    if bag.info.version != __version__:
        print_message(f"recorded by version {bag.info.version}, this is {__version__}")
    result = repeat_run(_host(bag, map_), bag.calls())
    if result.difference is not None:
        print_message(f"{bag.folder}: differs at {result.difference}")
        raise typer.Exit(1)
    _warn_of_end(bag)
    typer.echo(
        f"{bag.folder}: {result.ticks / 100:g} s of {result.clients} clients,"
        f" {result.bytes} bytes: all the same"
    )


def _host(bag: BagReader, map_: str | None) -> Host:
    """Return a host of the recorded conditions.

    Raises:
        RecordingError: If there is no map, or it is another one.
    """
    from radarsim.addons.recording.bag_folder import digest_of
    from radarsim.protocol.dialect import get_dialect
    from radarsim.scene.map_file import find_map, load_map
    from radarsim.server.host import Host
    from radarsim.simulation.config import SimulationConfig

    info = bag.info
    name = map_ or info.map
    if not name:
        raise RecordingError(
            f"{bag.folder} is of a client alone, expected one of a server to verify"
        )
    path, _ = find_map(name)
    if digest_of(path) != info.map_digest:
        raise RecordingError(f"{path} is not as it was, expected the map recorded")
    config = SimulationConfig(
        get_dialect(info.dialect), info.drive_unit, info.settings, info.robots
    )
    return Host(load_map(name), config=config, seed=info.seed, begins=False)


def _warn_of_end(bag: BagReader) -> None:
    if not bag.is_complete:
        print_message(f"{bag.folder}: {end_text(bag)}")


def end_text(bag: BagReader) -> str:
    """Return why a recording has no end, and what to do."""
    if bag.is_being_written:
        return "it is still being recorded, and read up to here"
    return f"it breaks off; 'radarsim recording repair {bag.folder}' makes it whole"


recording = typer.Typer(no_args_is_help=True, help="Look into recordings.")


@recording.command()
def info(folder: FolderArgument) -> None:
    """Print what a recording contains."""
    from radarsim.addons.recording.bag_folder import check_installed

    check_installed()
    from radarsim.addons.recording.bag_reader import BagReader

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
    from radarsim.addons.recording.bag_folder import check_installed

    check_installed()
    from radarsim.addons.recording.bag_reader import repair as repair_bag

    typer.echo(f"{folder}: complete, {repair_bag(folder)} messages")
