"""The commands of the lab, as entries."""

from typing import Final

from radarsim.cli.core_commands import RESULTS, old

COMMANDS: Final = (
    old("study", "Compare radar and lasers on the same maps.", RESULTS),
    old("sweep", "Scan, drive or map for all combinations of values.", RESULTS),
    old("figures", "Draw the figures of the thesis.", RESULTS),
    old("bench", "Measure the engine and the server on this machine.", RESULTS),
)
