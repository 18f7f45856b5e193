"""A matplotlib window that shows a figure while the program continues to run."""

from matplotlib.figure import Figure

from radarsim.errors import RadarsimError


class Window:
    """A window with a figure; stays open until the user or ``close`` closes it.

    Attributes:
        figure: The figure in the window, empty at first.
    """

    def __init__(self, size: tuple[float, float], instead: str) -> None:
        """Open a window that shows a figure.

        Args:
            size: Width and height of the figure, inches.
            instead: Alternative that the error suggests if no window can be opened.

        Raises:
            RadarsimError: If matplotlib cannot open a window.
        """
        from matplotlib import pyplot  # noqa: PLC0415 - only windows need pyplot

        self._pyplot = pyplot
        try:
            self.figure: Figure = pyplot.figure(figsize=size, layout="compressed")
            # Backends that only write files can create figures, but no windows.
            has_window = self.figure.canvas.required_interactive_framework is not None
            (self.figure.show if has_window else self.close)()
        except ImportError:  # the toolkit or the display of the backend is missing
            has_window = False
        if not has_window:
            text = f"matplotlib's backend {pyplot.get_backend()!r} opens no window here"
            expected = "expected a display and a toolkit such as tkinter"
            raise RadarsimError(f"{text}, {expected}; without a window use {instead}")

    def refresh(self) -> bool:
        """Draw the figure, and process mouse and keyboard events of the window.

        Returns:
            Whether the window is still open; a closed window draws nothing.
        """
        is_open = self._pyplot.fignum_exists(self.figure.number)
        if is_open:
            self.figure.canvas.draw()
            self.figure.canvas.flush_events()
        return is_open

    def close(self) -> None:
        """Close the window, if it is open."""
        self._pyplot.close(self.figure)
