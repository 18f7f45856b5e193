"""Entries of commands: ``radarsim --help`` lists commands without importing them.

This module has the entries of the core. A package registers its commands by an entry
point of the group ``radarsim.commands``, which names a list of entries in a module that
imports no large packages::

    [project.entry-points."radarsim.commands"]
    my_package = "my_package.entries:COMMANDS"
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import click

from radarsim import plugins
from radarsim.cli.command import PlanCommand
from radarsim.errors import MissingPackage

GROUP: Final = "radarsim.commands"  # group of the entry points
# Headings of commands in ``radarsim --help``.
SERVING: Final = "Serve and drive"
MAPS: Final = "Maps and sensors"
AUTONOMY: Final = "Autonomous robots"
RESULTS: Final = "Results"
PROGRAM: Final = "Program"
# Commands of optional parts of the program; if a part is missing, the error for its
# commands names the part.
BEYOND_THE_CORE: Final = {
    "autonomy": ("navigate", "map", "trials"),
    "addons": ("commander", "ros", "replay", "recording", "import", "spectrum"),
    "sweep": ("sweep",),
}


@dataclass(frozen=True, slots=True)
class CommandEntry:
    """A command that is imported only when it is used.

    Attributes:
        name: Name; two words for a command of a group, such as ``recording info``.
        target: ``module:function``; ``radarsim.cli.command`` describes the function.
        help: Summary of the command, one line.
        group: Heading above the command in ``radarsim --help``.
    """

    name: str
    target: str
    help: str
    group: str = "Other commands"

    def load(self) -> click.Command:
        """Import the command.

        Raises:
            MissingPackage: If the command's part of the program is not installed.
        """
        module, _, name = self.target.partition(":")
        found = getattr(plugins.import_part(module, f"{self.name}: "), name)
        if isinstance(found, click.Command):
            return found
        return PlanCommand(self.name.split()[-1], found)


def check_part_of(command: str) -> None:
    """Check that the part of radarsim that contains a command is installed.

    Raises:
        MissingPackage: If the part is not installed.
    """
    for part, names in BEYOND_THE_CORE.items():
        if command in names and not plugins.has(GROUP, part):
            raise MissingPackage(f"{command}: radarsim.{part} is not installed")


def load_entries() -> Iterator[CommandEntry]:
    """Yield the entries of the installed parts of radarsim, then of other packages."""
    own = plugins.OWN[GROUP]
    order = list(own)
    for name in sorted(
        plugins.names(GROUP),
        key=lambda each: order.index(each) if each in own else len(order),
    ):
        yield from plugins.load(GROUP, name)


def own_entries(groups: Mapping[str, Mapping[str, str]]) -> tuple[CommandEntry, ...]:
    """Return entries of this package's commands, named after their functions.

    Args:
        groups: Summaries of commands, by heading and by target, which is
            ``module:function`` without the prefix ``radarsim.``.
    """
    return tuple(
        CommandEntry(
            target.partition(":")[2].rstrip("_"), f"radarsim.{target}", text, group
        )
        for group, commands in groups.items()
        for target, text in commands.items()
    )


_LISTED: Final = "their values, sources and confidence."
COMMANDS: Final = own_entries(
    {
        SERVING: {
            "cli.serve:serve": "Serve a map to USARSim clients until interrupted.",
            "cli.drive:drive": (
                "Drive a robot from the keyboard, and see its sensor readings."
            ),
        },
        MAPS: {
            "cli.first_steps:demo": (
                "Draw a radar scan and a laser scan of a room with bushes."
            ),
            "cli.check:check": "Read a map and print its contents, or all its errors.",
            "cli.first_steps:new": (
                "Write a small map with comments, as a template for your own maps."
            ),
            "cli.scan:scan": "Scan a map without a server.",
            "cli.explain:explain": "Print everything that one beam meets.",
            "cli.presets:sensors": f"List the sensor presets: {_LISTED}",
            "cli.presets:robots": (
                "List the robot classes: their items, sizes and sources."
            ),
            "cli.presets:materials": f"List the materials of the library: {_LISTED}",
        },
        PROGRAM: {
            "cli.first_steps:docs": (
                "Show a page of the manual; without TOPIC, the list of topics."
            ),
        },
    }
)
