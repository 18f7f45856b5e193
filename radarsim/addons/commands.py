"""The commands of add-ons, as entries."""

from typing import Final

from radarsim.cli.entries import MAPS, SERVING, CommandEntry

COMMANDS: Final = (
    CommandEntry(
        "commander",
        "radarsim.addons.web.commands:commander",
        "See, drive and explain robots in a browser.",
        SERVING,
    ),
    CommandEntry(
        "ros",
        "radarsim.addons.ros.commands:ros",
        "Publish what the robots of a server sense as topics of ROS 2, and drive one.",
        SERVING,
    ),
    CommandEntry(
        "replay",
        "radarsim.addons.recording.commands:replay",
        "Play a recording to clients of the protocol, as they were sent it.",
        SERVING,
    ),
    CommandEntry(
        "recording",
        "radarsim.addons.recording.commands:recording",
        "Look into recordings.",
        SERVING,
    ),
    CommandEntry(
        "import",
        "radarsim.addons.imports.commands:import_",
        "Make a map, or a robot class, of a file of another program.",
        MAPS,
    ),
    CommandEntry(
        "spectrum",
        "radarsim.addons.fmcw.commands:spectrum",
        "Record turns of an FMCW radar: the power over range in each direction.",
        MAPS,
    ),
)
