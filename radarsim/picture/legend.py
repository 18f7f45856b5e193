"""What is said beside a picture: rows of samples under headings."""

from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D


class Legend:
    """Collects rows in the order in which they are to be shown."""

    def __init__(self) -> None:
        self._rows: list[tuple[Line2D, str]] = []
        self._headings: set[str] = set()

    def head(self, text: str) -> None:
        """Begin a group of rows."""
        self._headings.add(text)
        self._rows.append((Line2D([], [], linestyle="none"), text))

    def line(self, text: str, **style: Any) -> None:
        """Add a row with a sample of a line."""
        self._rows.append((Line2D([], [], **style), text))

    def mark(self, text: str, marker: str, **style: Any) -> None:
        """Add a row with a sample of a marker."""
        sample = Line2D([], [], marker=marker, linestyle="none", **style)
        self._rows.append((sample, text))

    def draw(self, figure: Figure) -> None:
        """Put the rows on the right of the picture, where they cover nothing."""
        samples = [sample for sample, _ in self._rows]
        shown = figure.legend(
            samples,
            [" "] * len(samples),  # a legend leaves out what begins with a "_"
            loc="outside right upper",
            fontsize="small",
            frameon=False,
        )
        for label, (_, text) in zip(shown.get_texts(), self._rows, strict=True):
            label.set_text(text)
            label.set_parse_math(False)
            if text in self._headings:
                label.set_fontweight("bold")
