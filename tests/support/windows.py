"""Programs that open windows, which run in a process of their own.

The backend of matplotlib is one for the whole process, and that of the tests has none.
"""

import os
import subprocess
import sys

# What programs begin with: how a user closes a window, and the content of the screen.
_BEGIN = """
from matplotlib import pyplot
from PIL import Image, ImageGrab

def close(number):  # while the window reacts to the mouse, in the next step
    window = pyplot.figure(number).canvas.manager.window
    window.after(0, window.tk.eval, window.protocol("WM_DELETE_WINDOW"))

def grab(width, height):
    return ImageGrab.grab(xdisplay="").crop((0, 0, width, height))
"""


def run_with(variables: dict[str, str], program: str) -> list[str]:
    """Return the lines that a program prints, or the last one of its error.

    Args:
        variables: Environment variables of the display, instead of the tests' own.
        program: Text in Python.
    """
    of_displays = ("COVERAGE", "DISPLAY", "WAYLAND", "MPLBACKEND")
    known = {k: v for k, v in os.environ.items() if not k.startswith(of_displays)}
    done = subprocess.run(
        (sys.executable, "-c", _BEGIN + program),
        env={**known, **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    return [*done.stdout.splitlines(), *done.stderr.splitlines()[-1:]]
