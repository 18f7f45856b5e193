"""The program's main function, run in this process."""

import io
import signal
import sys
from dataclasses import dataclass

import pytest

from radarsim.cli import main


@dataclass(frozen=True)
class Run:
    """Exit code and output of a command."""

    code: int
    out: bytes
    err: str

    @property
    def text(self) -> str:
        return self.out.decode()


def run_in_process(*arguments: object) -> Run:
    """Run the program's main function in this process.

    Messages are not wrapped, however long the paths in them are.
    """
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8") for _ in range(2))
    code = 0
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)  # ignored by its end
    before = {number: signal.getsignal(number) for number in numbers}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "2000")
        patch.setattr(sys, "argv", ["radarsim", *map(str, arguments)])
        patch.setattr(sys, "stdout", out)
        patch.setattr(sys, "stderr", err)
        try:
            main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 1
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
    return Run(code, _contents(out), _contents(err).decode())


def _contents(stream: io.TextIOWrapper) -> bytes:
    stream.flush()
    buffer = stream.buffer
    assert isinstance(buffer, io.BytesIO)
    return buffer.getvalue()
