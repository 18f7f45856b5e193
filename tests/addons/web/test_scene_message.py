import json

from radarsim.addons.web.scene_message import SceneMessages, describe_plan
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene


def test_plan_has_closed_outlines_of_what_the_scanner_is_level_with(
    foliage_room: Scene,
) -> None:
    plan = describe_plan(foliage_room)
    assert plan["level"] == foliage_room.level
    assert plan["bounds"][0] < plan["bounds"][2]
    parts = {part["name"]: part for part in plan["parts"]}
    (ring,) = parts["bush_1"]["outline"]
    assert ring[0] == ring[-1]
    assert not parts["bush_1"]["opaque"]
    assert parts["north_wall"]["opaque"]
    assert parts["floor"]["outline"] == []


def test_triangles_come_in_the_order_of_the_plan(scene_messages: SceneMessages) -> None:
    plan = json.loads(scene_messages.plan)
    triangles = json.loads(scene_messages.triangles)
    names = [part["name"] for part in plan["parts"]]
    assert [part["name"] for part in triangles["parts"]] == names
    for part in triangles["parts"]:
        assert len(part["vertices"]) % 3 == len(part["faces"]) % 3 == 0
        assert max(part["faces"]) < len(part["vertices"]) / 3


def test_legend_has_a_colour_for_each_material(scene_messages: SceneMessages) -> None:
    names = {each["name"] for each in scene_messages.materials}
    assert {"foliage", "concrete"} <= names
    assert all(each["colour"].startswith("#") for each in scene_messages.materials)


def test_plants_whose_leaves_cut_each_other_have_outlines_too() -> None:
    plan = describe_plan(load_map("marulan_trial"))
    assert sum(bool(part["outline"]) for part in plan["parts"]) > 5
