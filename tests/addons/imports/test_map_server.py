"""Maps of map_server become boxes that cover the occupied cells."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from commands import Run, run_in_process
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image
from scipy.spatial import cKDTree

import radarsim
from radarsim.addons.imports.map_server import rectangles, roomiest

Import = Callable[..., Run]

KEYS = "image: plan.pgm\nresolution: 0.5\norigin: [-2, -1, 0]\nnegate: 0\n"
KEYS += "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
PLAN = """
##########
#........#
#..##....#
#........#
##########
"""
SHADES = {"#": 0, ".": 254, "?": 205}
ROOM = """\
version: 1
objects:
  - {name: floor, box: [7, 6, 0.2], position: [0, 0, -0.1], material: concrete}
  - {name: north, box: [6.2, 0.2, 2], position: [0, 2.6, 1], material: concrete}
  - {name: south, box: [6.2, 0.2, 2], position: [0, -2.6, 1], material: concrete}
  - {name: east, box: [0.2, 5, 2], position: [3, 0, 1], material: concrete}
  - {name: west, box: [0.2, 5, 2], position: [-3, 0, 1], material: concrete}
  - {name: pillar, box: [0.6, 0.8, 2], position: [0.5, 0.3, 1], material: concrete,
     rotation_deg: [0, 0, 30]}
starts:
  - {name: RobotStart1, position: [-2, 0, 0]}
"""
WRONG = {
    "no number": KEYS.replace("0.5", "wide"),
    "no size": KEYS.replace("0.5", "0"),
    "infinite": KEYS.replace("-2", "1e999"),
    "two coordinates": KEYS.replace(", 0]", "]"),
    "no picture": KEYS.replace("plan", "other"),
    "outside": KEYS.replace("plan.pgm", "../plan.pgm"),
    "absolute": KEYS.replace("plan.pgm", "/etc/passwd"),
    "no YAML": KEYS.replace("]", ""),
    "no keys": "- 1\n- 2\n",
    "mode": KEYS + "mode: best\n",
    "no image": KEYS.partition("\n")[2],
    "not a picture": KEYS.replace("plan.pgm", "plan.yaml"),
    "far away": KEYS.replace("-2", "-5000"),
}


def write_plan(folder: Path, plan: str = PLAN, keys: str = KEYS) -> Path:
    rows = [[SHADES[sign] for sign in line] for line in plan.split()]
    Image.fromarray(np.array(rows, np.uint8)).save(folder / "plan.pgm")
    path = folder / "plan.yaml"
    path.write_text(keys)
    return path


@given(arrays(bool, st.tuples(st.integers(1, 12), st.integers(1, 12))))
def test_rectangles_cover_each_cell_once(
    cells: "np.ndarray[tuple[int, int], np.dtype[np.bool_]]",
) -> None:
    covered = np.zeros(cells.shape, int)
    for top, left, bottom, right in rectangles(cells):
        covered[top:bottom, left:right] += 1
    np.testing.assert_array_equal(covered, cells)


def test_start_is_where_there_is_most_room() -> None:
    free = np.zeros((9, 20), bool)
    free[1:4, 1:4] = free[1:8, 10:17] = True
    assert roomiest(free) == (4, 13)


def test_walls_are_where_the_picture_has_them(
    import_file: Import, tmp_path: Path
) -> None:
    assert import_file(write_plan(tmp_path), "--start", "-1.25,0.25,0").code == 0
    scene = radarsim.load_map(tmp_path / "map.yaml")
    laser = radarsim.load_sensor("laser", fov_deg=360, resolution_deg=90)
    scan = laser.scan(scene, (-1.25, 0.25, 0.2), radarsim.generator_for(0, "test"))
    # Behind, right, ahead (the block in the middle of the room), left.
    assert scan.ranges[:4] == pytest.approx([0.25, 0.75, 0.75, 0.75], abs=0.05)


@pytest.mark.parametrize(
    ("image", "model_path"),
    [
        ("../pictures/plan.pgm", "pictures"),
        ("pictures/plan.pgm", "."),
        ("../plan.pgm", "pictures"),
        ("/home/someone/maps/plan.pgm", "pictures"),
    ],
)
def test_picture_may_be_below_the_model_path(
    import_file: Import, tmp_path: Path, image: str, model_path: str
) -> None:
    (tmp_path / "pictures").mkdir()
    (tmp_path / "site").mkdir()
    write_plan(tmp_path / "pictures")
    path = tmp_path / "site" / "room.yaml"
    path.write_text(KEYS.replace("plan.pgm", image))
    refused = import_file(path)
    assert refused.code == 1
    assert f"{path}:1: no picture '{image}' in '{tmp_path}/site'" in refused.err
    assert "--model-path" in refused.err
    other = import_file(path, "--model-path", str(tmp_path / "site"))
    assert f"in '{tmp_path}/site', '{tmp_path}/site', expected" in other.err
    assert import_file(path, "--model-path", str(tmp_path / model_path)).code == 0


@pytest.mark.slow
def test_map_that_is_imported_and_mapped_again_agrees(
    import_file: Import, tmp_path: Path
) -> None:
    (tmp_path / "room.yaml").write_text(ROOM)
    maps = [tmp_path / "first", tmp_path / "second"]
    for served, out in zip(("room.yaml", "map.yaml"), maps, strict=True):
        done = run_in_process("map", str(tmp_path / served), "-o", str(out))
        assert done.code == 0
        if served == "room.yaml":
            path = out.with_suffix(".yaml")
            assert import_file(path, "--start=-2,0,0").code == 0
    first, second = map(occupied_of, maps)
    for cells, others in ((first, second), (second, first)):
        apart = cKDTree(others).query(cells)[0] / 0.05  # cells
        assert (apart < 2.6).mean() > 0.98  # a cell more aside, at corners
        assert apart.max() < 4


def occupied_of(name: Path) -> "np.ndarray[tuple[int, int], np.dtype[np.float64]]":
    """Return the centres of the occupied cells of a map, m, (N, 2)."""
    x, y, _ = yaml.safe_load(name.with_suffix(".yaml").read_text())["origin"]
    with Image.open(name.with_suffix(".pgm")) as picture:
        rows, columns = np.nonzero(np.asarray(picture)[::-1] == 0)
    return np.column_stack([x + 0.05 * columns, y + 0.05 * rows])


def test_turned_plan_is_turned(import_file: Import, tmp_path: Path) -> None:
    keys = KEYS.replace("[-2, -1, 0]", "[3, 4, 1.5707963268]")
    assert import_file(write_plan(tmp_path, keys=keys)).code == 0
    low, high = radarsim.load_map(tmp_path / "map.yaml").bounds
    assert low[:2] == pytest.approx([0.5, 4.0], abs=1e-4)
    assert high[:2] == pytest.approx([3.0, 9.0], abs=1e-4)


def test_unknown_cells_and_unread_keys_are_reported(
    import_file: Import, tmp_path: Path
) -> None:
    path = write_plan(tmp_path, PLAN.replace("..", ".?"), KEYS + "floor: 2\n")
    assert import_file(path, "--strict").code == 1
    done = import_file(path)
    assert "7: the key 'floor' is ignored" in done.text
    assert "unknown cells become free" in done.text


@pytest.mark.parametrize("name", WRONG)
def test_wrong_file_is_reported_with_its_line(
    name: str, import_file: Import, tmp_path: Path
) -> None:
    Image.new("L", (4, 4)).save(tmp_path.parent / "plan.pgm")
    path = write_plan(tmp_path, keys=WRONG[name])
    done = import_file(path)
    assert done.code == 1
    assert done.err.count("\n") == 1
    assert done.err.startswith(f"radarsim: {path}") or "plan.yaml:1" in done.err


@pytest.mark.parametrize("command", ["serve", "check"])
def test_command_on_a_map_of_map_server_names_the_import(
    tmp_path: Path, command: str
) -> None:
    path = write_plan(tmp_path)
    run = run_in_process(command, str(path), *["--port", "0"] * (command == "serve"))
    assert run.code == 1
    text = "a map of ROS map_server, which 'radarsim import' can convert"
    assert f"{path}:1:8: image: {text}" in run.err + run.text
