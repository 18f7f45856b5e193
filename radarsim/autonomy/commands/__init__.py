"""The commands ``navigate``, ``map`` and ``trials``, as entries."""

from typing import Final

from radarsim.cli.entries import AUTONOMY, CommandEntry

COMMANDS: Final = (
    CommandEntry(
        "navigate",
        "radarsim.autonomy.commands.navigate:navigate",
        "Drive a robot to a goal; exit with 3 if there is no path.",
        AUTONOMY,
    ),
    CommandEntry(
        "map",
        "radarsim.autonomy.commands.map:map_",
        "Explore with a robot and map what it senses.",
        AUTONOMY,
    ),
    CommandEntry(
        "trials",
        "radarsim.autonomy.commands.trials:trials",
        "Run navigators on several maps, and score them.",
        AUTONOMY,
    ),
)
