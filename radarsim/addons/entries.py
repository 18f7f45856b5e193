"""Lists the commands that add-ons provide, with their one-line descriptions."""

from typing import Final

from radarsim.cli.entries import MAPS, SERVING, own_entries

COMMANDS: Final = own_entries(
    {
        SERVING: {
            "addons.web.cli:commander": "Show and drive robots in a browser.",
            "addons.ros.cli:ros": (
                "Publish the readings of robots as ROS 2 topics, and drive a robot."
            ),
            "addons.recording.cli:replay": (
                "Play a recording to clients, or verify that its run can be repeated."
            ),
            "addons.recording.cli:recording": "Inspect or repair recordings.",
        },
        MAPS: {
            "addons.imports.cli:import_": (
                "Make a map or a robot class from a file of another program."
            ),
            "addons.fmcw.cli:spectrum": (
                "Record the power of an FMCW radar in each azimuth and range bin."
            ),
        },
    }
)
