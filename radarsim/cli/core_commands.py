"""The commands of the core, as entries."""

from typing import Final

from radarsim.cli.entries import CommandEntry

SERVING: Final = "Serve and drive"
MAPS: Final = "Maps and sensors"
AUTONOMY: Final = "Autonomous robots"
RESULTS: Final = "Results"
PROGRAM: Final = "Program"


def _old(name: str, help_: str, group: str) -> CommandEntry:
    """Return the entry of a command that is still made by typer."""
    return CommandEntry(name, f"radarsim.cli.legacy_commands:{name}", help_, group)


COMMANDS: Final = (
    _old("serve", "Serve a map to USARSim clients until interrupted.", SERVING),
    _old("drive", "Drive a robot from the keyboard, and see what it senses.", SERVING),
    _old("commander", "See, drive and explain robots in a browser.", SERVING),
    _old(
        "ros", "Publish robots of a server as topics of ROS 2, and drive one.", SERVING
    ),
    _old("replay", "Play a recording to clients, or verify it.", SERVING),
    _old("recording", "Look into recordings.", SERVING),
    _old("demo", "Draw what radar and laser see behind bushes.", MAPS),
    _old("check", "Read a map and print what is in it, or all its errors.", MAPS),
    _old("new", "Write a small map to start your own from.", MAPS),
    _old("import", "Make a map or a robot class of another program's file.", MAPS),
    CommandEntry(
        "scan", "radarsim.cli.scan:scan", "Scan a map without a server.", MAPS
    ),
    _old("explain", "Print everything that one beam meets.", MAPS),
    _old("spectrum", "Record turns of an FMCW radar: power over range.", MAPS),
    _old("sensors", "List the sensors with the source of each number.", MAPS),
    _old("materials", "List the library of materials likewise.", MAPS),
    CommandEntry(
        "navigate",
        "radarsim.autonomy.commands.navigate:navigate",
        "Drive a robot to a goal; exit with 3 if there is no path.",
        AUTONOMY,
    ),
    _old("map", "Explore with a robot and map what it senses.", AUTONOMY),
    _old("trials", "Run navigators on several maps, and score them.", AUTONOMY),
    _old("study", "Compare radar and lasers on the same maps.", RESULTS),
    _old("sweep", "Scan, drive or map for all combinations of values.", RESULTS),
    _old("figures", "Draw the figures of the thesis.", RESULTS),
    _old("bench", "Measure the engine and the server on this machine.", RESULTS),
    _old("docs", "Show a page of the manual.", PROGRAM),
)
