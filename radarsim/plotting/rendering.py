"""Figures as files that have the same bytes each time."""

import io
from typing import Final

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from radarsim.printable_text import escape_lines

FORMS: Final = ("png", "svg", "pdf")
# Keys of the date or the version that matplotlib would write.
_DATES: Final = {"png": "Software", "svg": "Date", "pdf": "CreationDate"}


def render(figure: Figure, form: str = "png", *, software: str = "radarsim") -> bytes:
    """Return a figure as a file of one of ``FORMS``; equal figures give equal bytes.

    Args:
        figure: The figure.
        form: File format.
        software: Name of the program in a PNG file.
    """
    _escape_texts(figure)
    data = io.BytesIO()
    metadata = {_DATES[form]: software if form == "png" else None}
    if form != "png":
        metadata["Creator"] = software
    with rc_context({"svg.hashsalt": "radarsim"}):
        FigureCanvasAgg(figure).print_figure(data, format=form, metadata=metadata)
    return data.getvalue()


def _escape_texts(figure: Figure) -> None:
    """Escape characters in names for which no file has a picture."""
    for text in figure.findobj(Text):
        if isinstance(text, Text):
            text.set_text(escape_lines(text.get_text()))
