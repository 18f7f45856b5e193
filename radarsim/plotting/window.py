"""A window of matplotlib, for programs that go on while it shows a figure."""

from matplotlib.figure import Figure

from radarsim.errors import RadarsimError


class Window:
    """A window that is open until the user or ``close`` closes it.

    Attributes:
        figure: What it shows; empty at first.
    """

    def __init__(self, size: tuple[float, float], instead: str) -> None:
        """Open it.

        Args:
            size: Width and height of the figure, inches.
            instead: What to use where no window can be opened, for the error.

        Raises:
            RadarsimError: If matplotlib can open no window.
        """
        from matplotlib import pyplot  # noqa: PLC0415 - pictures in files need none

        self._pyplot = pyplot
        try:
            self.figure: Figure = pyplot.figure(figsize=size, layout="compressed")
            # Backends for files have figures as well.
            has_window = self.figure.canvas.required_interactive_framework is not None
            (self.figure.show if has_window else self.close)()
        except ImportError:  # a backend that was asked for lacks its toolkit or display
            has_window = False
        if not has_window:
            text = f"matplotlib's backend {pyplot.get_backend()!r} opens no window here"
            expected = "expected a display and a toolkit such as tkinter"
            raise RadarsimError(f"{text}, {expected}; without a window use {instead}")

    def refresh(self) -> bool:
        """Draw the figure, and let the window react to the mouse and keys.

        Returns:
            Whether the window is open; once it is closed, nothing is drawn.
        """
        is_open = self._pyplot.fignum_exists(self.figure.number)
        if is_open:
            self.figure.canvas.draw()
            self.figure.canvas.flush_events()
        return is_open

    def close(self) -> None:
        """Close it, if it is open."""
        self._pyplot.close(self.figure)
