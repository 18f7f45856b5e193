"""The commands of the lab, as entries."""

from typing import Final

from radarsim.cli.entries import RESULTS, CommandEntry

COMMANDS: Final = (
    CommandEntry(
        "sweep",
        "radarsim.lab.sweep.commands:sweep",
        "Scan, drive or map for all combinations of values.",
        RESULTS,
    ),
)
