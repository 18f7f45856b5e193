"""The commands of the core, as entries."""

from typing import Final

from radarsim.cli.entries import CommandEntry

SERVING: Final = "Serve and drive"
MAPS: Final = "Maps and sensors"
AUTONOMY: Final = "Autonomous robots"
RESULTS: Final = "Results"
PROGRAM: Final = "Program"


def old(name: str, help_: str, group: str) -> CommandEntry:
    """Return the entry of a command that is still made by typer."""
    return CommandEntry(name, f"radarsim.cli.legacy_commands:{name}", help_, group)


COMMANDS: Final = (
    old("serve", "Serve a map to USARSim clients until interrupted.", SERVING),
    old("drive", "Drive a robot from the keyboard, and see what it senses.", SERVING),
    old("demo", "Draw what radar and laser see behind bushes.", MAPS),
    old("check", "Read a map and print what is in it, or all its errors.", MAPS),
    old("new", "Write a small map to start your own from.", MAPS),
    CommandEntry(
        "scan", "radarsim.cli.scan:scan", "Scan a map without a server.", MAPS
    ),
    old("explain", "Print everything that one beam meets.", MAPS),
    old("sensors", "List the sensors with the source of each number.", MAPS),
    old("materials", "List the library of materials likewise.", MAPS),
    old("docs", "Show a page of the manual.", PROGRAM),
)
