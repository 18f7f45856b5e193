"""Which files radarsim wrote itself, so that it overwrites no others."""

from pathlib import Path
from typing import Final

_HEAD_SIZE: Final = 1024  # bytes at the start of a file that show who wrote it


def is_by_radarsim(path: Path) -> bool:
    """Return whether a file is a picture or a page of figures that radarsim wrote."""
    from radarsim.figures.figure import is_radarsim_figure
    from radarsim.figures.page import GENERATOR

    try:
        with path.open("rb") as file:
            head = file.read(_HEAD_SIZE)
    except OSError:
        return False
    return is_radarsim_figure(head) or GENERATOR.encode() in head


def is_trace(path: Path) -> bool:
    """Return whether a file is empty or a trace of a run, by its first line."""
    from radarsim.navigation.run_log import trace_header

    try:
        with path.open("rb") as file:
            head = file.readline(_HEAD_SIZE)
    except OSError:
        return False
    return not head or head == trace_header().encode()
