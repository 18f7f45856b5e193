"""Meshes of millions of triangles, from the file to the first scan."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from forked_checks import ForkedChecks
from hostile_maps import encode_glb, encode_stl

from radarsim.scene.shapes import Mesh

pytestmark = pytest.mark.slow

MAX_MEMORY = 1.8 * 1024**3  # bytes of a process with 3 million triangles
CPU_SECONDS = 100
MAP = """\
version: 1
objects: [{{name: ball, mesh: ball.{suffix}, material: foliage, position: [9, 0, 3]}}]
starts: [{{name: RobotStart1, position: [0, 0, 0]}}]
"""


@pytest.fixture(scope="module")
def checks() -> Iterator[ForkedChecks]:
    checks = ForkedChecks(CPU_SECONDS)
    yield checks
    checks.close()


def bumpy_ball(rings: int) -> Mesh:
    """Return a closed ball of 4 ``rings`` (``rings`` - 1) triangles, radius 2 m."""
    count = 2 * rings
    polar, azimuth = np.meshgrid(
        np.linspace(0, np.pi, rings + 1)[1:-1],
        np.arange(count) * (2 * np.pi / count),
        indexing="ij",
    )
    radius = 2 + 0.05 * np.sin(40 * polar) * np.sin(40 * azimuth)
    x, y = np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth)
    points = (radius * np.stack([x, y, np.cos(polar)])).reshape(3, -1).T
    here = np.arange((rings - 2) * count).reshape(-1, count)
    right = np.roll(here, -1, axis=1)
    sides: list[Any] = [
        (here, here + count, right + count),
        (here, right + count, right),
    ]
    rim, last = np.arange(count), len(points) - count
    top, bottom = np.full(count, len(points)), np.full(count, len(points) + 1)
    sides += [(top, rim, np.roll(rim, -1))]
    sides += [(bottom, last + np.roll(rim, -1), last + rim)]
    faces = np.vstack([np.stack(side, axis=-1).reshape(-1, 3) for side in sides])
    poles = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, -2.0]])
    return np.vstack([points, poles]), faces.astype(np.int32)


@pytest.mark.parametrize(
    ("suffix", "encode"), [("stl", encode_stl), ("glb", encode_glb)]
)
def test_three_million_triangles_fit_into_memory(
    tmp_path: Path,
    checks: ForkedChecks,
    suffix: str,
    encode: Callable[..., bytes],
) -> None:
    vertices, faces = bumpy_ball(867)
    assert len(faces) > 3_000_000
    (tmp_path / f"ball.{suffix}").write_bytes(encode(vertices, faces))
    path = tmp_path / "map.yaml"
    path.write_text(MAP.format(suffix=suffix))
    result = checks.run(path)
    assert result.code == 0, result.output
    assert f"foliage, {len(faces)}".encode() in result.output
    assert result.memory < MAX_MEMORY
