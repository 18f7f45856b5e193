"""Entry points of the commands ``navigate``, ``map`` and ``trials``."""

from typing import Final

from radarsim.cli.entries import AUTONOMY, own_entries

COMMANDS: Final = own_entries(
    {
        AUTONOMY: {
            "autonomy.cli.navigate:navigate": (
                "Drive a robot to a goal; exit with 3 if there is no path."
            ),
            "autonomy.cli.map:map_": "Explore with a robot that builds a map.",
            "autonomy.cli.trials:trials": (
                "Run navigation algorithms on several maps, and score them."
            ),
        }
    }
)
