"""``radarsim replay``: play a recording to clients, or verify its run.

``radarsim recording`` lists the content of recordings, and repairs them.
"""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import click
from annotated_types import Ge, Gt
from rich.console import Console
from rich.table import Column, Table

from radarsim import __version__
from radarsim.cli.app import EntryGroup
from radarsim.cli.entries import CommandEntry
from radarsim.cli.output import print_message, start_log
from radarsim.cli.server_options import Listener, announce
from radarsim.errors import RecordingError
from radarsim.plans import RARE, Option

if TYPE_CHECKING:
    from radarsim.addons.recording.bag import BagReader

Folder = Annotated[Path, Option(is_argument=True, metavar="DIR")]


def replay(
    folder: Folder,
    listener: Listener,
    *,
    speed: Annotated[float, Gt(0)] = 1.0,
    verify: bool = False,
    map_: Annotated[str | None, Option(words="maps"), RARE] = None,
    client: Annotated[int | None, Ge(1), RARE] = None,
) -> int:
    """Play a recording to clients, or verify that its run can be repeated.

    Args:
        folder: Folder of the recording.
        listener: Where to listen.
        speed: Recorded seconds per second of real time.
        verify: Instead of playing, simulate the run again from the recorded commands;
            exit with 1 if any byte sent to clients differs.
        map_: Map for --verify; by default the recorded one.
        client: Number of the recorded client; by default the one that got most bytes.

    Returns:
        The exit code.
    """
    from radarsim.addons.recording.bag_folder import open_bag
    from radarsim.addons.recording.replay import serve_replay, writes_of

    bag = open_bag(folder)
    if verify:
        return _verify(bag, map_)
    start_log(logging.WARNING, "%(asctime)s %(levelname)s %(message)s")
    writes = writes_of(bag.calls(), client)
    if not bag.is_complete:
        print_message(f"{bag.folder}: {end_text(bag)}")
    address, port = listener.addresses, listener.port
    return asyncio.run(serve_replay(writes, address, port, announce, speed=speed))


def _verify(bag: BagReader, map_: str | None) -> int:
    """Simulate a run again, print whether the bytes are equal; return the exit code.

    Raises:
        RecordingError: If the recording has no map, or the map has changed.
    """
    from radarsim.addons.recording.bag_folder import check_map
    from radarsim.addons.recording.replay import repeat_run
    from radarsim.presets.fmcw_settings import RADAR_MODEL
    from radarsim.scene.map_file import load_map
    from radarsim.server.host import Host

    info = bag.info
    if info.version != __version__:
        print_message(f"recorded by radarsim {info.version}, replayed by {__version__}")
    if not info.map:
        raise RecordingError(
            f"{bag.folder} was recorded by a client, expected a server's recording"
        )
    name = map_ or info.map
    # With another map, the first scan would differ even if the program is the same.
    check_map(info, name)
    host = Host(load_map(name), config=info.config(), seed=info.seed)
    result = repeat_run(host, bag.calls())
    if result.difference:
        print_message(f"{bag.folder}: differs at {result.difference}")
        if info.radar_model != RADAR_MODEL:
            print_message(
                f"recorded with revision {info.radar_model} of the radar model, now it"
                f" is revision {RADAR_MODEL}: FMCW radars detect different targets"
            )
        return 1
    if not bag.is_complete:
        print_message(f"{bag.folder}: {end_text(bag)}")
    click.echo(
        f"{bag.folder}: {result.ticks / 100:g} s of {result.clients} clients,"
        f" {result.bytes} bytes: identical"
    )
    return 0


def end_text(bag: BagReader) -> str:
    """Return a message on why a recording is incomplete, and how to repair it."""
    if bag.is_being_written:
        return "it is still being recorded; the part written so far was read"
    return f"it is truncated; 'radarsim recording repair {bag.folder}' repairs it"


def info(folder: Folder) -> None:
    """Print map, duration and topics.

    Args:
        folder: Folder of the recording.
    """
    from radarsim.addons.recording.bag_folder import open_bag

    bag = open_bag(folder)
    counts: Counter[tuple[str, str]] = Counter()
    last = 0
    for message in bag.messages():
        counts[message.topic, message.type] += 1
        last = max(last, message.time)
    conditions = bag.info
    click.echo(f"{folder}: {last / 1e9:.2f} s, radarsim {conditions.version}")
    click.echo(
        f"map {conditions.map or conditions.level}, seed {conditions.seed},"
        f" dialect {conditions.dialect}"
    )
    table = Table(Column("topic", overflow="fold"), "type", "messages")
    for (topic, type_), count in sorted(counts.items()):
        table.add_row(topic, type_, str(count))
    Console().print(table)
    if not bag.is_complete:
        click.echo(end_text(bag))


def repair(folder: Folder) -> None:
    """Repair a truncated recording, and keep all messages that can be read.

    Args:
        folder: Folder of the recording.
    """
    from radarsim.addons.recording.bag_folder import check_installed

    check_installed()
    from radarsim.addons.recording.bag import repair as repair_bag

    click.echo(f"{folder}: complete, {repair_bag(folder)} messages")


recording = EntryGroup(
    "recording",
    (
        CommandEntry("info", f"{__name__}:info", "Print map, duration and topics."),
        CommandEntry(
            "repair",
            f"{__name__}:repair",
            "Repair a truncated recording, and keep all messages that can be read.",
        ),
    ),
    help="Inspect or repair recordings.",
)
