"""The commands of the core, as entries."""

from typing import Final

from radarsim.cli.entries import CommandEntry

SERVING: Final = "Serve and drive"
MAPS: Final = "Maps and sensors"
AUTONOMY: Final = "Autonomous robots"
RESULTS: Final = "Results"
PROGRAM: Final = "Program"


def _own(name: str, help_: str, group: str, module: str = "") -> CommandEntry:
    target = f"radarsim.cli.{module or name}:{name}"
    return CommandEntry(name, target, help_, group)


COMMANDS: Final = (
    _own("serve", "Serve a map to USARSim clients until interrupted.", SERVING),
    _own("drive", "Drive a robot from the keyboard, and see what it senses.", SERVING),
    _own(
        "demo",
        "Draw what radar and laser see of a room behind bushes, in one picture.",
        MAPS,
    ),
    _own("check", "Read a map and print what is in it, or all its errors.", MAPS),
    _own("new", "Write a small map to start your own from, with comments.", MAPS),
    _own("scan", "Scan a map without a server.", MAPS),
    _own("explain", "Print everything that one beam meets.", MAPS),
    _own(
        "sensors",
        "List the sensors: their numbers, sources and confidence.",
        MAPS,
        "presets",
    ),
    _own(
        "materials",
        "List the library of materials: their numbers, sources and confidence.",
        MAPS,
        "presets",
    ),
    _own(
        "docs",
        "Show a page of the manual; without a topic, the list of topics.",
        PROGRAM,
    ),
)
