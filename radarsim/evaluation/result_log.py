"""Logs of results: files of JSON lines that are only ever added to.

A run that is killed leaves at most an incomplete last line. Readers leave it out, and
the next run cuts it off.
"""

import json
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, TypeAlias

from radarsim.atomic_write import write_atomically

Result: TypeAlias = Mapping[str, Any]


def read_log(file: Path, keys: Collection[str], expected: str) -> list[dict[str, Any]]:
    """Read the results of earlier runs; there are none if the file does not exist.

    Args:
        file: The log.
        keys: Keys that each result has.
        expected: What a line is, for the message about one that is not.

    Raises:
        OSError: If the file exists and cannot be read.
        ValueError: If it has other lines; it names the first.
    """
    if not file.exists():
        return []
    with file.open(encoding="utf-8", errors="replace") as lines:
        return [
            _read_line(line, keys, f"{file}:{number}: expected {expected}")
            for number, line in enumerate(lines, 1)
            if line.endswith("\n")
        ]


def _read_line(line: str, keys: Collection[str], complaint: str) -> dict[str, Any]:
    try:
        result = json.loads(line)
    except ValueError:
        result = None
    if not isinstance(result, dict) or not {*result} >= {*keys}:
        raise ValueError(complaint)
    return result


@contextmanager
def opened_log(file: Path | None) -> Iterator[Callable[[Result], None]]:
    """Open a log to add results to it, each of which is on the disk at once.

    Args:
        file: The log, which is created if necessary; None for none.

    Yields:
        A function that adds a result.

    Raises:
        OSError: If the file cannot be written.
    """
    if file is not None:
        _cut_incomplete_line(file)
    with nullcontext() if file is None else file.open("a", encoding="utf-8") as log:

        def add(result: Result) -> None:
            if log is not None:
                log.write(as_line(result))
                log.flush()

        yield add


def as_line(result: Result) -> str:
    """Return a result as a line of JSON."""
    return json.dumps(result, allow_nan=False) + "\n"


def _cut_incomplete_line(file: Path) -> None:
    if file.exists():
        data = file.read_bytes()
        complete = data.rfind(b"\n") + 1
        if complete < len(data):
            write_atomically({file: data[:complete]})
