"""What the figures write beside their drawings, and parts of plans."""

from typing import Final

from matplotlib.figure import Figure

TITLE_GAP: Final = 0.16  # inches above the title
TITLE_SIZE: Final = 17  # points


def as_words(name: str) -> str:
    """Return the name of an object as words: ``crate_low`` as ``crate low``."""
    return name.replace("_", " ")


def draw_title(drawing: Figure, text: str) -> None:
    """Write the title of a figure at its upper left."""
    _, height = drawing.get_size_inches()
    place = (0.02, 1 - TITLE_GAP / height)
    drawing.text(*place, text, va="top", fontsize=TITLE_SIZE, fontweight="bold")
