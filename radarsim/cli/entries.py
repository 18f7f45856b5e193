"""Entries of commands: what ``radarsim --help`` shows without importing them.

A package hands in its commands by an entry point of the group ``radarsim.commands``,
which names a list of entries in a module that imports nothing heavy::

    [project.entry-points."radarsim.commands"]
    my_package = "my_package.commands:COMMANDS"
"""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Final

import click

from radarsim import plugins
from radarsim.cli.command import PlanCommand
from radarsim.errors import MissingPackage

COMMANDS: Final = "radarsim.commands"
# Commands of parts that can be absent: whoever asks for one hears what it needs.
BEYOND_THE_CORE: Final = {
    "autonomy": ("navigate", "map", "trials"),
    "addons": ("commander", "ros", "replay", "recording", "import", "spectrum"),
    "lab": ("study", "sweep", "figures", "bench"),
}


@dataclass(frozen=True, slots=True)
class CommandEntry:
    """A command that is imported when it is used.

    Attributes:
        name: Its name; of two words for a command of a group, as ``recording info``.
        target: ``module:function``; the function is as in ``radarsim.cli.command``.
        help: What it does, in a line.
        group: Heading of commands in ``radarsim --help``.
    """

    name: str
    target: str
    help: str
    group: str = "Other commands"

    def load(self) -> click.Command:
        """Import the command."""
        module, _, name = self.target.partition(":")
        found = getattr(import_module(module), name)
        if isinstance(found, click.Command):
            return found
        return PlanCommand(self.name.split()[-1], found)


def check_part_of(command: str) -> None:
    """Check that the part of the program that a command is in is there.

    Raises:
        MissingPackage: If it is not.
    """
    for part, names in BEYOND_THE_CORE.items():
        if command in names and not plugins.has(COMMANDS, part):
            raise MissingPackage(f"{command}: radarsim.{part} is not installed")


def load_entries() -> Iterator[CommandEntry]:
    """Yield the entries of the parts that are there, then of other packages."""
    own = plugins.OWN[COMMANDS]
    order = list(own)
    for name in sorted(
        plugins.names(COMMANDS),
        key=lambda each: order.index(each) if each in own else len(order),
    ):
        yield from plugins.load(COMMANDS, name)
