"""Lists the commands of the add-ons with their one-line descriptions."""

from typing import Final

from radarsim.cli.entries import MAPS, SERVING, own_entries

COMMANDS: Final = own_entries(
    {
        SERVING: {
            "addons.web.cli:commander": "See, drive and explain robots in a browser.",
            "addons.ros.cli:ros": (
                "Publish what the robots of a server sense as topics of ROS 2, and"
                " drive one."
            ),
            "addons.recording.cli:replay": (
                "Play a recording: send its lines to clients of the protocol again."
            ),
            "addons.recording.cli:recording": "Look into recordings.",
        },
        MAPS: {
            "addons.imports.cli:import_": (
                "Make a map, or a robot class, from a file of another program."
            ),
            "addons.fmcw.cli:spectrum": (
                "Record turns of an FMCW radar: the power over range in each direction."
            ),
        },
    }
)
