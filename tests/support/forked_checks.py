"""``radarsim check`` in processes that are forked from a warm one, within limits.

Starting an interpreter takes seconds; a fork of one that has already imported
everything and checked a map takes milliseconds.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

GUARD_BYTES = 8 * 1024**3  # of address space, against what would harm the machine


@dataclass(frozen=True)
class Result:
    """How a check ended."""

    code: int  # negative for a signal
    cpu: float  # s
    memory: int  # bytes
    output: bytes


class ForkedChecks:
    """Runs checks, one after the other."""

    def __init__(self, cpu_seconds: int) -> None:
        """Start the process that is forked."""
        env = {k: v for k, v in os.environ.items() if not k.startswith("COVERAGE")}
        self._process = subprocess.Popen(
            [sys.executable, __file__, str(cpu_seconds)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=env,
        )

    def run(self, path: Path | str) -> Result:
        """Run ``radarsim check`` with a map."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{path}\n".encode())
        self._process.stdin.flush()
        fields = json.loads(self._process.stdout.readline())
        return Result(**fields | {"output": bytes.fromhex(fields["output"])})

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait()


def main() -> None:
    """Fork for each path on standard input; write a line of JSON for each."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    cpu_seconds = int(sys.argv[1])
    _check("forest_edge")  # imports what maps with meshes need
    for line in sys.stdin:
        answers.write(json.dumps(_fork(line.rstrip("\n"), cpu_seconds)) + "\n")
        answers.flush()


def _fork(path: str, cpu_seconds: int) -> dict[str, Any]:
    with tempfile.TemporaryFile() as output:
        child = os.fork()
        if child == 0:
            os.dup2(output.fileno(), 1)
            os.dup2(output.fileno(), 2)
            resource.setrlimit(resource.RLIMIT_CPU, (cpu_seconds, cpu_seconds + 5))
            resource.setrlimit(resource.RLIMIT_AS, (GUARD_BYTES, GUARD_BYTES))
            code = _check(path)
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
        _, status, usage = os.wait4(child, 0)
        output.seek(0)
        return {
            "code": os.waitstatus_to_exitcode(status),
            "cpu": usage.ru_utime + usage.ru_stime,
            "memory": usage.ru_maxrss * 1024,
            "output": output.read(16 * 2**20).hex(),
        }


def _check(path: str) -> int:
    from radarsim.cli.app import app

    try:
        app(["check", path])
    except SystemExit as error:
        return error.code if isinstance(error.code, int) else 99
    except Exception:  # noqa: BLE001 - what a user would see as a traceback
        sys.excepthook(*sys.exc_info())
        return 98
    return 97


if __name__ == "__main__":
    main()
