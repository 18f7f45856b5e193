"""Sweeps: the same task for all combinations of parameters, as one table."""

from typing import Final

from radarsim.cli.entries import RESULTS, CommandEntry

COMMANDS: Final = (
    CommandEntry(
        "sweep",
        "radarsim.sweep.commands:sweep",
        "Scan, drive or map for all combinations of values.",
        RESULTS,
    ),
)
