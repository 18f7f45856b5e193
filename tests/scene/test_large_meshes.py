"""Meshes of millions of triangles, from the file to the first scan."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from forked_checks import ForkedChecks

from benchmarks.scenes import ball, write_mesh_map

pytestmark = pytest.mark.slow

MAX_MEMORY = 1.8 * 1024**3  # bytes of a process with 3 million triangles
CPU_SECONDS = 100


@pytest.fixture(scope="module")
def checks() -> Iterator[ForkedChecks]:
    checks = ForkedChecks(CPU_SECONDS)
    yield checks
    checks.close()


@pytest.mark.parametrize("suffix", ["stl", "glb"])
def test_three_million_triangles_fit_into_memory(
    tmp_path: Path, checks: ForkedChecks, suffix: str
) -> None:
    mesh = ball(867)
    assert len(mesh[1]) > 3_000_000
    result = checks.run(write_mesh_map(tmp_path, mesh, suffix))
    assert result.code == 0, result.output
    assert f"foliage, {len(mesh[1])}".encode() in result.output
    assert result.memory < MAX_MEMORY
