"""Text of small map files, and meshes for them, for the tests of maps."""

from pathlib import Path

import pytest

from radarsim.errors import MapError
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene

HEAD = """\
version: 1
materials:
  stone: {density: opaque}
  leaf: {density: 0.7}
  sheet: {sheet_loss: 0.25}
objects:
"""
CUBE = """\
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 2\nv 1 0 2\nv 1 1 2\nv 0 1 2
usemtl Leaves
f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8
"""
BACK = "f 2 3 4 1\nf 7 6 5 8\nf 6 2 1 5\nf 7 3 2 6\nf 8 4 3 7\nf 5 1 4 8\n"
FLAT = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 3 4 1\nf 4 3 2\nf 2 1 4\n"
# The bark is open.
TREE = CUBE + "v 0 0 -1\nv 1 0 -1\nv 0 1 -1\nusemtl Bark\nf 9 10 11\n"


@pytest.fixture
def mesh_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Create a working directory with a few mesh files."""
    monkeypatch.chdir(tmp_path)
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    (meshes / "cube.obj").write_text(CUBE)
    (meshes / "tree.obj").write_text(TREE)
    (meshes / "plain.obj").write_text(CUBE.replace("usemtl Leaves", ""))
    (meshes / "lid.obj").write_text(CUBE.replace("f 5 6 7 8\n", ""))
    (meshes / "double.obj").write_text(CUBE + BACK)
    (meshes / "flat.obj").write_text(FLAT)
    (meshes / "line.obj").write_text("v 0 0 0\nv 1 0 0\nf 1 2 1\n")
    return tmp_path


def load(text: str) -> Scene:
    """Load a map of this text from ``m.yaml``."""
    path = Path("m.yaml")
    path.write_text(text)
    return load_map(path)


def problems(text: str) -> list[str]:
    """Return the problems of an invalid map."""
    with pytest.raises(MapError) as caught:
        load(text)
    return caught.value.problems


def objects(*lines: str) -> str:
    """Return the text of a map with these objects."""
    return HEAD + "".join(f"  - {{{line}}}\n" for line in lines)
