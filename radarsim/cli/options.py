"""Options that several commands take.

Nothing heavy is imported here: ``radarsim --help`` answers at once.
"""

from enum import StrEnum
from typing import Annotated

import typer


class DriveUnit(StrEnum):
    """Unit of DRIVE."""

    RAD_PER_S = "rad_per_s"
    REV_PER_S = "rev_per_s"


JsonOption = Annotated[bool, typer.Option("--json", help="For programs.")]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="Of all randomness.")]
