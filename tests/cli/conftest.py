import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from radarsim.cli import main


@dataclass(frozen=True)
class Run:
    """What a command line did."""

    code: int
    out: bytes
    err: str

    @property
    def text(self) -> str:
        return self.out.decode()


RunCommand = Callable[..., Run]


@pytest.fixture
def radarsim(
    monkeypatch: pytest.MonkeyPatch, capfdbinary: pytest.CaptureFixture[bytes]
) -> RunCommand:
    """Run the program's own main in this process."""

    def run(*arguments: str) -> Run:
        monkeypatch.setattr(sys, "argv", ["radarsim", *arguments])
        code = 0
        before = signal.getsignal(signal.SIGTERM)
        try:
            main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 1
        finally:
            signal.signal(signal.SIGTERM, before)
        sys.stdout.flush()
        caught = capfdbinary.readouterr()
        return Run(code, caught.out, caught.err.decode())

    return run
