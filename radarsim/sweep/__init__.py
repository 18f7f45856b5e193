"""Sweeps: run a task for all combinations of parameters, and write a result table."""

from typing import Final

from radarsim.cli.entries import RESULTS, own_entries

_ABOUT: Final = "Run scans, trials or mapping for all combinations of parameter values."
COMMANDS: Final = own_entries({RESULTS: {"sweep.cli:sweep": _ABOUT}})
