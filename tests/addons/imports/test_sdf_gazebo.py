"""Worlds become what Gazebo shows: closed forms give places and sizes."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from commands import Run

import radarsim
from radarsim.scene.scene import Part

Import = Callable[..., Run]

Imported = Callable[..., dict[str, Part]]

FUEL = "https://fuel.gazebosim.org/1.0/OpenRobotics/models/Fir tree"


def model(name: str, shape: str, inside: str = "", tag: str = "collision") -> str:
    holder = f"<{tag} name='c'><geometry>{shape}</geometry></{tag}>" * bool(shape)
    link = f"<link name='l'>{holder}</link>"
    return f"<model name='{name}'><static>1</static>{inside}{link}</model>"


def box_model(side: float, inside: str = "", name: str = "m") -> str:
    return model(name, f"<box><size>{side} {side} {side}</size></box>", inside)


def parts_of(folder: Path) -> dict[str, Part]:
    """Return the parts of the imported map by the names of models."""
    parts = radarsim.load_map(folder / "map.yaml").parts
    found = {part.object_name.partition("_")[0]: part for part in parts}
    assert len(found) == len(parts)
    return found


def volume(part: Part) -> float:
    a, b, c = (part.vertices[part.faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.fixture
def imported(import_world: Import, tmp_path: Path) -> Imported:
    """A function that imports a world, and returns the parts of its map."""

    def run(content: str, *options: str) -> dict[str, Part]:
        done = import_world(content, *options)
        assert done.code == 0, done.err
        return parts_of(tmp_path)

    return run


CONE = "<cone><radius>0.5</radius><length>2</length></cone>"
CAPSULE = "<capsule><radius>0.5</radius><length>2</length></capsule>"
ELLIPSOID = "<ellipsoid><radii>1 2 0.5</radii></ellipsoid>"


def polyline(*points: str, height: float = 2) -> str:
    inside = "".join(f"<point>{point}</point>" for point in points)
    return f"<polyline>{inside}<height>{height}</height></polyline>"


L_SHAPE = polyline("0 0", "3 0", "3 1", "1 1", "1 2", "0 2")
HOLE = polyline("0 0", "0 4", "4 4", "4 0") + polyline("1 1", "2 1", "2 3", "1 3")


@pytest.mark.parametrize(
    ("shape", "low", "high", "expected"),
    [
        (CONE, (-0.5, -0.5, -1), (0.5, 0.5, 1), math.pi * 0.25 * 2 / 3),
        (CAPSULE, (-0.5, -0.5, -1.5), (0.5, 0.5, 1.5), math.pi * (0.5 + 1 / 6)),
        (ELLIPSOID, (-1, -2, -0.5), (1, 2, 0.5), 4 / 3 * math.pi),
        (L_SHAPE, (0, 0, 0), (3, 2, 2), 8),
        (HOLE, (0, 0, 0), (4, 4, 2), 28),
    ],
    ids=["cone", "capsule", "ellipsoid", "polyline", "polyline with a hole"],
)
def test_shape_that_maps_lack_becomes_a_closed_mesh(
    imported: Imported,
    shape: str,
    low: tuple[float, ...],
    high: tuple[float, ...],
    expected: float,
) -> None:
    part = imported(model("m", shape))["m"]
    assert part.closed
    np.testing.assert_allclose(part.bounds, [low, high], atol=1e-5)
    # Round shapes are inscribed.
    assert expected * 0.985 < volume(part) < expected * 1.00001


def test_two_of_a_shape_share_a_mesh(imported: Imported, tmp_path: Path) -> None:
    imported(model("a", CONE) + model("b", CONE))
    assert len([*(tmp_path / "map_meshes").iterdir()]) == 1


def test_polyline_that_crosses_itself_is_left_out(import_world: Import) -> None:
    crossed = model("m", polyline("0 0", "1 1", "1 0", "0 1"))
    done = import_world(crossed + 2 * box_model(1))
    assert "crosses itself" in done.text
    assert "1 of 3 models left out: 1 with a wrong <polyline>" in done.err


POSES = {
    # The middle of a cube of 1 m, and the contents of its model.
    "placement frame": (
        (4, 0, 1),
        "<pose>4 0 3 0 0 0</pose><frame name='hook'><pose>0 0 2 0 0 0</pose></frame>",
    ),
    "turned placement frame": (
        (2, 1, 0),
        "<pose>2 0 0 0 0 0</pose>"
        "<frame name='hook'><pose>1 0 0 0 0 1.5707963267948966</pose></frame>",
    ),
    "placement frame on a joint": (
        (-1, 0, 0),
        "<frame name='hook' attached_to='j'><pose>0 0 1 0 0 0</pose></frame>"
        "<joint name='j'><pose>1 0 -1 0 0 0</pose><child>l</child></joint>",
    ),
    "placement frame in an inner model": (
        (-3, 0, 0),
        "<frame name='hook' attached_to='inner::at'/>"
        "<model name='inner'><pose>1 0 0 0 0 0</pose>"
        "<frame name='at'><pose>2 0 0 0 0 0</pose></frame></model>",
    ),
}


@pytest.mark.parametrize("name", POSES)
def test_model_stands_where_its_placement_frame_is_placed(
    imported: Imported, name: str
) -> None:
    middle, inside = POSES[name]
    content = box_model(1, inside).replace("<model ", "<model placement_frame='hook' ")
    content = content.replace(
        "<model placement_frame='hook' name='inner'", "<model name='inner'"
    )
    part = imported(content)["m"]
    np.testing.assert_allclose(part.bounds.mean(axis=0), middle, atol=1e-5)


def test_pose_may_be_relative_to_a_frame_or_a_model(imported: Imported) -> None:
    content = (
        "<frame name='f'><pose>1 0 0 0 0 1.5707963267948966</pose></frame>"
        + box_model(1, "<pose relative_to='f'>2 0 0 0 0 0</pose>", "a")
        + box_model(1, "<pose relative_to='a'>0 1 0 0 0 0</pose>", "b")
        + box_model(1, "<pose relative_to='b::l'>0 0 5 0 0 0</pose>", "c")
    )
    parts = imported(content)
    for name, middle in {"a": (1, 2, 0), "b": (0, 2, 0), "c": (0, 2, 5)}.items():
        got = parts[name].bounds.mean(axis=0)
        np.testing.assert_allclose(got, middle, atol=1e-5)


@pytest.mark.parametrize("size", [1, 1e-320, 1e308])
def test_quaternion_may_have_any_length(imported: Imported, size: float) -> None:
    turn = f"<pose rotation_format='quat_xyzw'>0 0 0 0 {size} 0 {size}</pose>"
    content = model("m", "<box><size>1 2 3</size></box>", turn)
    part = imported(content)["m"]  # pitch is 90 degrees
    np.testing.assert_allclose(np.ptp(part.bounds, axis=0), [3, 2, 1], atol=1e-5)


@pytest.mark.parametrize("shape", [CONE, CAPSULE, ELLIPSOID, L_SHAPE])
def test_shape_that_is_too_large_is_left_out(import_world: Import, shape: str) -> None:
    for tag, power in (("radius", 308), ("radii", 308), ("height", 307)):
        shape = shape.replace(f"</{tag}>", f"e{power}</{tag}>")
    state = STATE.format("5 2 1 0 0 0.5")  # its scale makes radii infinite
    content = model("m", shape) + 2 * box_model(1, name="o") + state
    assert "1 of 3 models left out: 1 with <" in import_world(content).err


@pytest.mark.parametrize("count", [1, 2, 90, 200])
def test_frames_that_are_relative_to_each_other_are_refused(
    import_world: Import, count: int
) -> None:
    frames = "".join(
        f"<frame name='f{i}' attached_to='f{(i + 1) % count}'/>" for i in range(count)
    )
    moved = box_model(1, "<pose relative_to='f0'/>")
    done = import_world(frames + moved)
    assert done.code == 1
    assert "a chain of more than 100 relative poses, expected no loop" in done.err


def test_time_does_not_double_with_each_level(imported: Imported) -> None:
    inside = ""
    for level in range(40):
        frame = "<frame name='x' attached_to='m::x'/>" if level else "<frame name='x'/>"
        inside = f"{frame}<model name='m' placement_frame='x'>{inside}</model>"
    content = box_model(1, inside.partition("/>")[2]).replace(
        "<model ", "<model placement_frame='m::x' ", 1
    )
    part = imported(content)["m"]
    np.testing.assert_allclose(part.bounds.mean(axis=0), 0, atol=1e-5)


STATE = """
<state world_name="w"><sim_time>12 5</sim_time><model name="m">
<pose>5 2 1 0 0 0.5</pose><scale>1 4 2</scale>
<link name="l"><pose>{}</pose></link></model></state>"""


@pytest.mark.parametrize(
    ("shape", "sides"),
    [
        ("<box><size>1 1 1</size></box>", (1, 4, 2)),
        ("<sphere><radius>0.5</radius></sphere>", (4, 4, 4)),
        ("<cylinder><radius>0.5</radius><length>1</length></cylinder>", (4, 4, 2)),
        ("<ellipsoid><radii>0.5 0.5 0.5</radii></ellipsoid>", (1, 4, 2)),
        (CONE, (4, 4, 4)),
    ],
    ids=["box", "sphere", "cylinder", "ellipsoid", "cone"],
)
def test_world_that_was_saved_from_the_window_is_in_its_state(
    imported: Imported, shape: str, sides: tuple[float, ...]
) -> None:
    inside = "<pose>0 0 0.5 0 0 0</pose>"
    content = model("m", shape, inside) + STATE.format("5 2 1 0 0 0.5")
    part = imported(content)["m"]
    c, s = math.cos(0.5), math.sin(0.5)
    back = (part.vertices - [5, 2, 1]) @ [[c, -s, 0], [s, c, 0], [0, 0, 1]]
    half = np.array(sides) / 2
    np.testing.assert_allclose(back.min(axis=0), -half, atol=1e-3)
    np.testing.assert_allclose(back.max(axis=0), half, atol=1e-3)


def test_link_that_has_moved_is_where_the_state_has_it(imported: Imported) -> None:
    content = box_model(1) + STATE.format("7 2 1 0 0 0")
    part = imported(content)["m"]
    np.testing.assert_allclose(part.bounds, [[6.5, 0, 0], [7.5, 4, 2]], atol=1e-5)


@pytest.mark.parametrize(
    ("config", "side"),
    [
        ("<sdf version='1.4'>a.sdf</sdf><sdf version='1.6'>b.sdf</sdf>", 2),
        ("<sdf version='1.10'>a.sdf</sdf><sdf version='1.9'>b.sdf</sdf>", 1),
        ("<sdf version='99.1'>a.sdf</sdf><sdf version='1.9'>b.sdf</sdf>", 2),
        ("<sdf version='99.1'>a.sdf</sdf>", 1),
        ("<sdf>b.sdf</sdf>", 2),
        ("<name>m</name>", 3),
        ("<sdf", 3),
        (None, 3),
    ],
)
def test_model_config_names_the_file_of_the_newest_version(
    imported: Imported, tmp_path: Path, config: str | None, side: float
) -> None:
    folder = tmp_path / "models" / "crate"
    folder.mkdir(parents=True)
    for number, name in enumerate(("a.sdf", "b.sdf", "model.sdf"), 1):
        (folder / name).write_text(f"<sdf>{box_model(number)}</sdf>")
    if config is not None:
        (folder / "model.config").write_text(f"<model>{config}</model>")
    content = "<include><uri>model://crate</uri></include>"
    options = "--model-path", str(tmp_path / "models")
    part = imported(content, *options)["m"]
    np.testing.assert_allclose(np.ptp(part.bounds, axis=0), side)


@pytest.mark.parametrize("uri", [FUEL, f"{FUEL}/2", FUEL.replace(" ", "%20")])
@pytest.mark.parametrize(
    "place",
    ["Fir tree", "fir tree/2", "fuel.gazebosim.org/openrobotics/models/fir tree/2"],
)
def test_models_of_fuel_are_found_below_the_model_path(
    imported: Imported, tmp_path: Path, uri: str, place: str
) -> None:
    folder = tmp_path / "models" / place
    (folder / "meshes").mkdir(parents=True)
    for other in ("1", "old"):  # not the newest
        (folder.parent / other).mkdir()
    mesh = f"<mesh><uri>{FUEL}/2/files/meshes/a.stl</uri></mesh>"
    (folder / "model.sdf").write_text(f"<sdf>{model('m', mesh)}</sdf>")
    (folder / "meshes" / "a.stl").write_text(
        "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 3 0 0\n"
        "vertex 0 2 0\nendloop\nendfacet\nendsolid a\n"
    )
    content = f"<include><uri>{uri}</uri></include>"
    options = "--model-path", str(tmp_path / "models")
    part = imported(content, *options)["m"]
    np.testing.assert_allclose(part.bounds, [[0, 0, 0], [3, 2, 0]], atol=1e-5)


VISUALS = (
    model("crown", "<sphere><radius>1.2</radius></sphere>", tag="visual")
    + model("grass", "<box><size>0.5 3 0.8</size></box>", tag="visual")
    + model("pole", "<box><size>1 1 1</size></box>")
)


def test_visuals_are_imported_in_place_of_collisions(
    import_world: Import, tmp_path: Path
) -> None:
    done = import_world(VISUALS, "--visuals", "--material", "*crown*=hedge")
    assert "the model 'pole' is left out: it has no visual" in done.text
    assert "1 of 3 models left out: 1 without a visual" in done.err
    parts = parts_of(tmp_path)
    assert parts.keys() == {"crown", "grass"}
    np.testing.assert_allclose(np.ptp(parts["crown"].bounds, axis=0), 2.4, atol=1e-5)
    np.testing.assert_allclose(np.ptp(parts["grass"].bounds, axis=0), [0.5, 3, 0.8])
    assert parts["crown"].material.name == "hedge"
    done = import_world(VISUALS)
    assert done.text.count("it has no collision (see --visuals)") == 2
    assert parts_of(tmp_path).keys() == {"pole"}


def test_summary_counts_all_that_is_left_out(import_world: Import) -> None:
    part = "<collision name='d'><geometry><heightmap/></geometry></collision></link>"
    plane = FUEL.replace("Fir tree", "Ground Plane")
    uris = ("model://sun", "model://ground_plane", plane)
    content = "".join(f"<include><uri>{uri}</uri></include>" for uri in uris)
    content += "<actor/><actor/><road/>" + box_model(1).replace("</link>", part)
    done = import_world(content)
    left_out = [line for line in done.text.splitlines() if "is left out" in line]
    assert len(left_out) == 4
    also = "also 2 <actor>s, 1 <road>, 1 shape"
    assert f"0 of 1 models left out; {also}\n" in done.err
    assert done.text.count("is not needed") == 3


def test_file_that_is_included_has_one_model(
    import_world: Import, tmp_path: Path
) -> None:
    (tmp_path / "a").mkdir()
    two = box_model(1, name="first") + box_model(1, name="second")
    (tmp_path / "a" / "model.sdf").write_text(f"<sdf>{two}</sdf>")
    include = "<include><uri>model://a</uri><name>{}</name></include>"
    content = include.format("one") + include.format("two")
    done = import_world(content, "--model-path", str(tmp_path))
    assert parts_of(tmp_path).keys() == {"one", "two"}
    assert "the model 'second' is left out: only the first is read" in done.text
    assert "1 of 3 models left out: 1 not the first in an included file" in done.err


def test_map_without_a_floor_is_reported(import_world: Import) -> None:
    content = box_model(1, "<pose>3 0 0.5 0 0 0</pose>")
    assert "no floor below the start" in import_world(content).err
    assert "no floor" not in import_world(content, "--start", "3,0,0").err


HEAD = "<?xml version='1.0'{}?>"


@pytest.mark.parametrize(
    ("head", "encoding", "name"),
    [
        ("", "latin-1", "Büsche"),
        ("", "utf-16", "Büsche"),
        (HEAD.format(""), "latin-1", "Büsche"),
        (HEAD.format(""), "utf-8-sig", "Büsche"),
        (HEAD.format(" encoding='UTF-8'"), "latin-1", "Büsche"),
        (HEAD.format(" encoding='windows-1252'"), "windows-1252", "Büsche€"),
    ],
)
def test_world_may_be_in_another_encoding(
    import_file: Import, tmp_path: Path, head: str, encoding: str, name: str
) -> None:
    """Also in Latin-1 if it says that it is UTF-8."""
    path = tmp_path / "w.world"
    text = f"{head}<sdf><world name='w'>{box_model(1, name=name)}</world></sdf>"
    path.write_bytes(text.encode(encoding))
    assert import_file(path).code == 0
    assert parts_of(tmp_path).keys() == {name}
