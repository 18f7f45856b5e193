import math

import pytest

from radarsim.cli.check import summarise
from radarsim.geometry import Pose3
from radarsim.scene.material import OPAQUE, Material
from radarsim.scene.scene import Crate, Part, Scene, StartPose, Trial
from radarsim.scene.shapes import box, sphere

WOOD = Material("wood")
LEAF = Material("leaf", 0.7)
SMOKE = Material("smoke", 0.0, 0.5, solid=False, sheet_loss=0.25)


def test_summary_lists_the_content_of_a_map() -> None:
    crown = sphere(2.0)
    parts = (
        Part("crate", WOOD, *box(2, 4, 6)),
        Part("tree", WOOD, *box(1, 1, 1)),
        Part("tree", LEAF, *crown),
    )
    starts = (StartPose("RobotStart1", Pose3(-8, 0.25, 0, yaw=1.5707963)),)
    materials = {each.name: each for each in (WOOD, LEAF, SMOKE)}
    scene = Scene("room", "DM-Room", parts, starts, materials)
    assert summarise(scene) == [
        "map room, level DM-Room",
        "2 objects, 1304 triangles",
        "  x from -2.000 to 2.000 m",
        "  y from -2.000 to 2.000 m",
        "  z from -3.000 to 3.000 m",
        "1 start, x y z in m, yaw in degrees",
        "  RobotStart1: -8.000 0.250 0.000, 90.0",
        "3 materials",
        "  wood: density opaque, laser opaque, solid; 24 triangles",
        "  leaf: density 0.7 per m, laser opaque, solid; 1280 triangles",
        "  smoke: density 0 per m, laser 0.5 per m, can be driven through,"
        " loses 0.25 at each surface; 0 triangles",
        "objects, with their materials and triangles",
        "  crate: wood, 12",
        "  tree: wood, 12",
        "  tree: leaf, 1280",
    ]


def test_single_items_are_in_the_singular() -> None:
    vertices, faces = box(1, 1, 1)
    parts = (Part("leaf", LEAF, vertices, faces[:1]),)
    lines = summarise(Scene("room", "DM-Room", parts, (), {"leaf": LEAF}))
    assert lines[1] == "1 object, 1 triangle"
    assert lines[6:8] == [
        "1 material",
        "  leaf: density 0.7 per m, laser opaque, solid; 1 triangle",
    ]


@pytest.mark.parametrize(
    ("material", "text"),
    [
        (
            Material("m", 0.0, 0.0, radar_db=(2.0, 3.25, 4.0), laser_db=23),
            "2, 3.25, 4 dB per m at 24, 77, 94 GHz, laser 23 dB per m, solid",
        ),
        (
            Material("m", 0.7, 0.5, radar_db=(2.0, 2.0, 2.0), laser_db=1),
            "density 0.7 per m and 2 dB per m, laser 0.5 per m and 1 dB per m, solid",
        ),
        (
            Material("m", radar_mirror=True, absorption_db=7.3),
            "density opaque, laser opaque, solid, a mirror to radar,"
            " keeps 7.3 dB of radar",
        ),
        (
            Material("m", laser_mirror=True, laser_absorption_db=OPAQUE),
            "density opaque, laser opaque, solid, a mirror to laser,"
            " keeps all of laser",
        ),
        (
            Material("m", 0.0, 0.0, solid=False, rain=12.5),
            "density 0 per m, laser 0 per m, can be driven through, rain of 12.5 mm/h",
        ),
    ],
)
def test_summary_of_a_material_has_all_its_properties(
    material: Material, text: str
) -> None:
    lines = summarise(Scene("room", "DM-Room", materials={"m": material}))
    assert f"  m: {text}; 0 triangles" in lines


def test_summary_has_air_and_trial() -> None:
    fog = Material("fog", 0.0, 0.0, solid=False)
    trial = Trial("RobotStart1", (7.0, -2.5), 0.5)
    lines = summarise(Scene("room", "DM-Room", air=fog, trial=trial))
    assert "air: fog" in lines
    assert "trial: RobotStart1 to 7.000 -2.500, safety distance 0.500 m" in lines


def test_crates_are_listed_only_if_there_are_any() -> None:
    crate = Crate("crate1", (1, 0.5, 0.8), (2, -1, 0.4), math.radians(30))
    with_one = summarise(Scene("room", "DM-Room", crates=(crate,)))
    title = "1 crate, x y z in m, yaw in degrees, size in m"
    begin = with_one.index(title)
    assert with_one[begin + 1] == "  crate1: 2.000 -1.000 0.400, 30.0, 1 x 0.5 x 0.8"
    without = summarise(Scene("room", "DM-Room"))
    assert without == with_one[:begin] + with_one[begin + 2 :]


def test_objects_that_differ_in_their_number_only_are_in_one_line() -> None:
    posts = [Part(f"post_{i}", WOOD, *box(1, 1, 1)) for i in range(1, 6)]
    trees = [
        Part(f"tree{i}", material, *box(1, 1, 1))
        for i in range(2)
        for material in (WOOD, LEAF)
    ]
    scene = Scene("room", "DM-Room", (*posts, *trees), (), {"wood": WOOD, "leaf": LEAF})
    lines = summarise(scene)
    assert lines[lines.index("objects, with their materials and triangles") + 1 :] == [
        "  post_1 to post_5 (5): wood, 60",
        "  tree0: wood, 12",
        "  tree1: wood, 12",
        "  tree0: leaf, 12",
        "  tree1: leaf, 12",
    ]


def test_mirrors_are_reported_with_the_sensors_that_they_mislead() -> None:
    pane = Material("pane", radar_mirror=True)
    sheet = Material("sheet", radar_mirror=True, laser_mirror=True)
    wall = Material("wall")
    sizes = [("door", sheet), ("shed", wall), *((f"pane_{k}", pane) for k in range(3))]
    parts = tuple(Part(name, material, *box(1, 1, 1)) for name, material in sizes)
    lines = summarise(Scene("room", "DM-Room", parts))
    begin = lines.index("mirrors, in which sensors see what stands elsewhere")
    assert lines[begin + 1 :] == [
        "  door: to radar and laser",
        "  pane_0 to pane_2 (3): to radar",
    ]
    lines = summarise(Scene("room", "DM-Room", parts[1:2]))
    assert not any(line.startswith("mirrors") for line in lines)
