"""The commands of add-ons, as entries."""

from typing import Final

from radarsim.cli.core_commands import MAPS, SERVING, old

COMMANDS: Final = (
    old("commander", "See, drive and explain robots in a browser.", SERVING),
    old(
        "ros", "Publish robots of a server as topics of ROS 2, and drive one.", SERVING
    ),
    old("replay", "Play a recording to clients, or verify it.", SERVING),
    old("recording", "Look into recordings.", SERVING),
    old("import", "Make a map or a robot class of another program's file.", MAPS),
    old("spectrum", "Record turns of an FMCW radar: power over range.", MAPS),
)
