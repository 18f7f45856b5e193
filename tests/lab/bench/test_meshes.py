from pathlib import Path

import pytest

from radarsim.lab.bench.engine import ball, mesh_maps, write_map
from radarsim.scene.map_file import load_map


@pytest.mark.parametrize("suffix", ["stl", "glb"])
def test_ball_is_closed_in_both_files(tmp_path: Path, suffix: str) -> None:
    scene = load_map(write_map(tmp_path, ball(10), suffix))
    assert scene.triangles == 360
    assert scene.parts[0].closed


def test_maps_of_meshes_are_measured_in_both_formats() -> None:
    rows = list(mesh_maps(10, 0.01))
    assert [row.name for row in rows] == ["360 triangles, STL", "360 triangles, GLB"]
    assert all(row.value > 0 and row.limit for row in rows)
