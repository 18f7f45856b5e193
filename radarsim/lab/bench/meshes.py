"""Benchmark of meshes: group k of the table.

A map with one closed mesh is loaded and made ready for rays. The reference is what
trimesh takes to read the file and embreex to build its own scene of it, which tells
neither whether the mesh is closed nor which side of it is outside.
"""

import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
import trimesh

from radarsim.lab.bench.timing import BenchmarkRow, compare
from radarsim.raycast import embree
from radarsim.raycast.tracer import Tracer, tracer_of
from radarsim.scene.map_file import load_map
from radarsim.scene.shapes import Mesh

RINGS: Final = 410  # of the ball that is measured: 670,760 triangles
MAP: Final = """\
version: 1
objects: [{{name: ball, mesh: {}, material: foliage}}]
starts: [{{name: RobotStart1, position: [9, 0, 0]}}]
"""


def ball(rings: int) -> Mesh:
    """Create a closed, uneven ball of 4 ``rings`` (``rings`` - 1) triangles, 2 m."""
    count = 2 * rings
    polar, azimuth = np.meshgrid(
        np.linspace(0, np.pi, rings + 1)[1:-1],
        np.arange(count) * (2 * np.pi / count),
        indexing="ij",
    )
    radius = 2 + 0.05 * np.sin(40 * polar) * np.sin(40 * azimuth)
    x, y = np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth)
    points = (radius * np.stack([x, y, np.cos(polar)])).reshape(3, -1).T
    poles = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, -2.0]])
    here = np.arange((rings - 2) * count).reshape(-1, count)
    there = np.roll(here, -1, axis=1)
    rim, last = np.arange(count), len(points) - count
    top, bottom = np.full(count, len(points)), np.full(count, len(points) + 1)
    sides: list[Any] = [
        (here, here + count, there + count),
        (here, there + count, there),
        (top, rim, np.roll(rim, -1)),
        (bottom, last + np.roll(rim, -1), last + rim),
    ]
    faces = np.vstack([np.stack(side, axis=-1).reshape(-1, 3) for side in sides])
    return np.vstack([points, poles]), faces.astype(np.int32)


def write_map(folder: Path, mesh: Mesh, suffix: str) -> Path:
    """Write a map of one mesh, and the mesh beside it; return the path of the map."""
    content: Any = trimesh.Trimesh(*mesh, process=False).export(file_type=suffix)
    (folder / f"ball.{suffix}").write_bytes(content)
    path = folder / f"{suffix}.yaml"
    path.write_text(MAP.format(f"ball.{suffix}"))
    return path


def mesh_maps(rings: int, seconds: float) -> Iterator[BenchmarkRow]:
    """Measure CPU time from a map to its tracer, against reading and building only."""
    mesh = ball(rings)
    for suffix in ("stl", "glb"):
        with TemporaryDirectory() as folder:
            path = write_map(Path(folder), mesh, suffix)
            result = compare(
                partial(_load, path),
                partial(_read_and_build, path.with_name(f"ball.{suffix}")),
                seconds=seconds,
                clock=time.process_time,
            )
        name = f"{len(mesh[1])} triangles, {suffix.upper()}"
        note = f"{result.subject:.2f} s against {result.reference:.2f}"
        yield BenchmarkRow("k", name, result.ratio, "x", 1.0, note)


def _load(path: Path) -> Tracer:
    return tracer_of(load_map(path))


def _read_and_build(path: Path) -> embree.FirstHits:
    mesh: Any = trimesh.load_mesh(path, process=False)
    triangles = embree.Mesh(mesh.vertices, mesh.faces)
    return embree.FirstHits([triangles], np.zeros((1, 3)), np.eye(3)[:1])
