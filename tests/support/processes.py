"""``radarsim`` in processes of their own."""

import os
import subprocess
import sys
from typing import IO, Any


def start_radarsim(
    *words: str, stdout: int | IO[Any] = subprocess.PIPE
) -> subprocess.Popen[bytes]:
    """Start a command that a test can interrupt; stderr is a pipe.

    It runs without coverage, whose lock would never be released if the handler of a
    signal raised an exception while it is held.
    """
    env = {k: v for k, v in os.environ.items() if not k.startswith("COVERAGE")}
    command = (sys.executable, "-m", "radarsim", *words)
    return subprocess.Popen(command, stdout=stdout, stderr=subprocess.PIPE, env=env)
