"""Hostile maps and meshes, which `check` must refuse or read within bounds."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from forked_checks import ForkedChecks, Result
from hostile_maps import hostile_maps, write_files

pytestmark = pytest.mark.slow

CASES = hostile_maps()
CPU_SECONDS = 40  # of a check, with a margin of ten
MAX_MEMORY = 1024**3  # bytes above what a small map takes
MAX_OUTPUT = 200_000  # bytes
CONTROL = re.compile(rb"[\x00-\x09\x0b-\x1f\x7f]|\xc2[\x80-\x9f]|\xe2\x80[\xaa-\xae]")


@pytest.fixture(scope="module")
def checks() -> Iterator[ForkedChecks]:
    checks = ForkedChecks(CPU_SECONDS)
    yield checks
    checks.close()


@pytest.fixture(scope="module")
def usual(checks: ForkedChecks) -> Result:
    return checks.run("empty_room")


@pytest.mark.parametrize("name", CASES)
def test_hostile_map_is_read_or_refused(
    tmp_path: Path, checks: ForkedChecks, usual: Result, name: str
) -> None:
    result = checks.run(write_files(tmp_path, CASES[name]()))
    assert usual.code == 0
    assert result.code in (0, 1), result.output[-2000:]
    assert result.memory - usual.memory < MAX_MEMORY
    assert len(result.output) < MAX_OUTPUT
    assert b"Traceback" not in result.output
    assert not CONTROL.search(result.output)
