"""``radarsim`` in processes of their own."""

import os
import pty
import resource
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
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


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Let files grow to a size alone, bytes, as if the disk were full then.

    Meanwhile Python writes no byte code: a module whose byte code is cut off can never
    be imported again.
    """
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    writes_bytecode, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        sys.dont_write_bytecode = writes_bytecode
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, ignored)


def on_terminal(*words: str, **variables: str) -> str:
    """Return what a command prints on a terminal."""
    outer, inner = pty.openpty()
    environment = {**os.environ, "TERM": "xterm-256color", **variables}
    with subprocess.Popen(
        (sys.executable, "-m", "radarsim", *words),
        stdin=inner,
        stdout=inner,
        stderr=inner,
        env=environment,
    ) as process:
        os.close(inner)
        text = b""
        while select.select([outer], [], [], 60)[0]:
            try:
                text += os.read(outer, 65536)
            except OSError:  # the other end is closed
                break
    os.close(outer)
    assert process.returncode in (0, 2)
    return text.decode()


def has_ended(process: int) -> bool:
    """Wait up to a minute until a process has ended; return whether it has."""
    status = Path(f"/proc/{process}/stat")
    deadline = time.monotonic() + 60
    # Nobody may have waited for a process that has ended.
    while status.exists() and ") Z " not in status.read_text():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.05)
    return True
