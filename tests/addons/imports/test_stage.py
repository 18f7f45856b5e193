"""Worlds of Stage become maps whose walls are where Stage has them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from commands import Run
from PIL import Image

import radarsim

Import = Callable[..., Run]

WORLD = """# A room, a table and a robot
include "plan.inc"
window ( size [ 600 600 ] scale 30 )
floorplan
(
  name "room"  # ten by five pixels in a white frame
  size [10 5 1.5]
  pose [5 2.5 0 0]
  bitmap "plan.png"
)
table ( pose [3 1.5 0 90] )
pioneer ( name "r0" pose [7.5 2.5 0 180] )
"""
INCLUDED = """
define floorplan model ( color "gray30" boundary 1 )
define table model
(
  size [1 0.5 0.8]
  block
  (
    points 4
    point[0] [0 0] point[1] [0 2] point[2] [2 2] point[3] [2 0]
    z [0 1]
  )
)
define pioneer position ( size [0.4 0.4 0.2] )
"""
ROOM = ["#" * 10, *["#........#"] * 3, "#" * 10]
TRIANGLE = """model ( size [2 2 1] block ( points 3
  point[0] [0 0] point[1] [4 0] point[2] [0 4] ) )"""
BOX = "model ( size [1 2 0.5] pose [3 0 0 0] )\n"
WRONG = {
    "not closed": "model ( size [1 1 1]\n",
    "closed twice": BOX + ")\n",
    "bracket": "model ( size [1 1 1 )\n",
    "quote": 'model ( name "a )\n',
    "no value": "model ( size )\n",
    "words": "model ( size [a b c] )\n",
    "negative": "model ( size [1 -1 1] )\n",
    "infinite": "model ( pose [1e999 0 0 0] )\n",
    "two numbers": "model ( pose [1 0] )\n",
    "no picture": 'model ( bitmap "none.png" )\n',
    "outside": 'model ( bitmap "../plan.png" )\n',
    "not a picture": 'model ( bitmap "w.world" )\n',
    "white": 'model ( bitmap "white.png" )\n',
    "missing point": TRIANGLE.replace("point[1]", "point[7]"),
    "flat": TRIANGLE.replace("[0 4]", "[9 0]"),
    "two points": TRIANGLE.replace("points 3", "points 2"),
    "endless": TRIANGLE.replace("points 3", "points 1e999"),
    "deep": "model (" * 5000,
    "definitions": "define a0 model()\n"
    + "".join(f"define a{i + 1} a{i} (a{i}() a{i}())\n" for i in range(30))
    + "a30()\n",
    "includes itself": 'include "w.world"\n',
    "no name": "define ( )\n",
    "huge": TRIANGLE.replace("[0 4]", "[0 1e300]"),
    "no text": "\udcff",
}


def write(folder: Path, text: str) -> Path:
    rows = ["." * 14, *(f"..{row}.." for row in ROOM), "." * 14]
    shades = [[0 if sign == "#" else 255 for sign in row] for row in rows]
    Image.fromarray(np.array(shades, np.uint8)).save(folder / "plan.png")
    (folder / "plan.inc").write_text(INCLUDED)
    path = folder / "w.world"
    path.write_text(text, "utf-8", "surrogateescape")
    return path


def ranges(scene: radarsim.Scene, pose: tuple[float, float, float]) -> list[float]:
    """Return the ranges behind, right, ahead, left."""
    laser = radarsim.load_sensor("laser", fov_deg=360, resolution_deg=90)
    scan = laser.scan(scene, pose, radarsim.generator_for(0, "test"))
    return [float(each) for each in scan.ranges[:4]]


def test_walls_and_models_are_where_stage_has_them(
    import_file: Import, tmp_path: Path
) -> None:
    path = write(tmp_path, WORLD)
    done = import_file(path)
    (line,) = done.text.splitlines()
    assert line.startswith(f"{path}:12: ")
    assert "'r0'" in line
    scene = radarsim.load_map(tmp_path / "map.yaml")
    (start,) = scene.starts
    assert start.pose.numbers()[:3] == pytest.approx([7.5, 2.5, 0])
    low, high = scene.bounds
    assert low == pytest.approx([-0.05, -0.05, -0.2])
    assert high == pytest.approx([10.05, 5.05, 1.5])
    # The table is turned: 0.5 m along x, 1 m along y.
    at = ranges(scene, (3.0, 3.0, 0.0))
    assert at == pytest.approx([2, 1, 6, 1], abs=0.05)
    at = ranges(scene, (2.0, 1.5, 0.0))
    assert at == pytest.approx([1, 0.5, 0.75, 2.5], abs=0.05)


def test_models_stand_on_models(import_file: Import, tmp_path: Path) -> None:
    text = BOX.replace(" )", " model ( size [1 1 1] pose [0 0 0 45] ) )")
    assert import_file(write(tmp_path, text)).text == ""
    _, high = radarsim.load_map(tmp_path / "map.yaml").bounds
    assert high == pytest.approx([3 + 0.5**0.5, 1, 1.5], abs=1e-4)


def test_polygon_becomes_boxes(import_file: Import, tmp_path: Path) -> None:
    assert "polygon" in import_file(write(tmp_path, TRIANGLE)).text
    scene = radarsim.load_map(tmp_path / "map.yaml")
    low, high = scene.bounds
    assert [*low, *high] == pytest.approx([-1, -1, 0, 1, 1, 1], abs=0.05)
    assert ranges(scene, (2.0, -0.5, 0.0))[0] == pytest.approx(1.5, abs=0.05)


def test_what_is_left_out_is_told_with_its_line(
    import_file: Import, tmp_path: Path
) -> None:
    more = """include "none.inc"
include "../a.inc"
sicklms ( pose [0 0 0 0] )
model ( obstacle_return 0 )
unit_angle "radians"
model ( blocks 1 )
"""
    path = write(tmp_path, BOX + more)
    lines = import_file(path).text.splitlines()
    words = ("none.inc", "../a.inc", "sicklms", "'model'", "unit_angle", "numbered")
    for number, word in enumerate(words, 2):
        found = [line for line in lines if line.startswith(f"{path}:{number}: ")]
        assert len(found) == 1
        assert word in found[0]
    assert len(lines) == len(words)


@pytest.mark.parametrize(
    ("keys", "is_wall"),
    [
        ("ranger_return 1", True),
        ("ranger_return 0", True),
        ("laser_return 1", True),
        ("ranger_return -1", False),
        ("laser_return 0", False),
    ],
)
def test_what_scanners_see_is_a_wall(
    import_file: Import, tmp_path: Path, keys: str, is_wall: bool
) -> None:
    wall = f'model ( name "glass" size [1 2 1] obstacle_return 0 {keys} )\n'
    done = import_file(write(tmp_path, BOX + wall))
    assert "the model 'glass'" in done.text
    assert done.code == 0
    left_out = "0 of 2" if is_wall else "1 of 2"
    assert f"{left_out} models left out" in done.err
    scene = radarsim.load_map(tmp_path / "map.yaml")
    seen = 1.5 if is_wall else 4.5
    assert ranges(scene, (-2.0, 0.0, 0.0))[2] == pytest.approx(seen, abs=0.05)


def test_world_of_unknown_models_is_mostly_missing(
    import_file: Import, tmp_path: Path
) -> None:
    unknown = 'include "none.inc"\n' + 3 * "crate ( pose [5 5 0 0] )\n"
    done = import_file(write(tmp_path, 2 * BOX + unknown))
    assert done.code == 1
    assert done.err.endswith("3 of 5 models left out: 3 of an unknown kind\n")
    done = import_file(write(tmp_path, unknown))
    reasons = "3 of 3 models left out: 3 of an unknown kind"
    assert done.err.endswith(f"becomes an object of a map: {reasons}\n")


def test_included_files_are_found_below_the_model_path(
    import_file: Import, tmp_path: Path
) -> None:
    (tmp_path / "inc").mkdir()
    (tmp_path / "inc" / "box.inc").write_text(f"define thing {BOX}")
    path = write(tmp_path, 'include "box.inc"\nthing ( )\n')
    assert import_file(path, "--model-path", str(tmp_path / "inc")).text == ""


@pytest.mark.parametrize("name", WRONG)
def test_wrong_file_is_told_with_its_line(
    name: str, import_file: Import, tmp_path: Path
) -> None:
    path = write(tmp_path, WRONG[name])
    Image.new("L", (4, 4), 255).save(tmp_path / "white.png")
    Image.new("L", (4, 4), 0).save(tmp_path.parent / "plan.png")
    done = import_file(path)
    assert done.code == 1
    assert done.err.count("\n") == 1
    assert done.err.startswith(f"radarsim: {path}:")
